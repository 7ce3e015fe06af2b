"""Navigation (thesis 4.5): from waypoints to velocity commands, and recovery from failed drives."""
