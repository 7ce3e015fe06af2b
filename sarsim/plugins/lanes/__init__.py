"""The lanes and the maze of RoboCup Rescue: arenas, and the judge of a lane."""
