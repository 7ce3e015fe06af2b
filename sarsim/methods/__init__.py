"""The robot's methods by name, shipped and user-defined: created, tried out and checked while they run."""
