"""The rescue leagues: the brief of a mission, the rules, and the files that are handed in at its end."""
