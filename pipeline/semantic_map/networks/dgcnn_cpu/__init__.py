"""DGCNN's forward pass hand-written for CPUs."""
