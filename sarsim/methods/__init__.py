"""The robot's methods by name, shipped and user-defined: their names are checked, and instances created."""
