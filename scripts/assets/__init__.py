"""Generates files of assets/: the laboratory floor and the people."""
