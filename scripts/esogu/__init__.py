"""What ``scripts/make_esogu.py`` makes the ESOGU laboratory floor of."""
