"""The rescue leagues: the brief of a mission, the rules, and the files that are submitted at its end."""
