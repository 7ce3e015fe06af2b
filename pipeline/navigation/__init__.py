"""Navigation (thesis 4.5): from way points to velocity commands, and recovery if driving fails."""
