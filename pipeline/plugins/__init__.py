"""Parts of the robot's software that a run asks for by name; nothing of the core imports them."""
