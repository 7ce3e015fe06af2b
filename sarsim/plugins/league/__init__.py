"""The missions of the rescue leagues: what is submitted, and how it is scored."""
