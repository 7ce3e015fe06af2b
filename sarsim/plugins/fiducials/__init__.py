"""AprilTags on the walls of an arena, and a score of the map from the distances between the tags."""
