"""Finds the robot's methods by name, shipped or user-defined: checks the names and creates instances."""
