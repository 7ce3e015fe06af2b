"""Navigation (thesis 4.5): from way points to velocity commands, and what to do where that fails."""
