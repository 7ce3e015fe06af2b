"""Optional parts of the robot's software, which a run selects by name; no module of the core imports them."""
