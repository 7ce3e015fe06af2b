"""The missions of the rescue leagues: what is handed in, and how it is scored."""
