"""AprilTags on the walls of an arena, and the score of the map that they allow."""
