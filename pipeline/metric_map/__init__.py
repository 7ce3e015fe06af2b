"""Metric map (thesis 3.1): a 3D occupancy grid."""
