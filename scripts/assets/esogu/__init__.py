"""Plan and parts of the ESOGU laboratory floor, which ``scripts/assets/make_esogu.py`` builds."""
