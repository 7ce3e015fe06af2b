"""The missions of the rescue leagues: their clock, the submission of their files, and their scores."""
