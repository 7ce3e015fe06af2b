"""Victims (thesis 3.5): people detected in images, located on the map and confirmed from several positions."""
