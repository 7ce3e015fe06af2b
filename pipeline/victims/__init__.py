"""Victims (thesis 3.5): people in the image, placed on the map and confirmed from several places."""
