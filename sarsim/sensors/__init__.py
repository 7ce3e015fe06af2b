"""Sensors: camera, light, air, noise models, and odometry."""
