"""What ``scripts/assets/make_esogu.py`` makes the ESOGU laboratory floor of."""
