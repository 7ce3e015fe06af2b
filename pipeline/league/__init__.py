"""The rescue leagues: what a mission asks for, by which rules, and the files that are handed in at its end."""
