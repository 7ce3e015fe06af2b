"""A hand-written forward pass of DGCNN for CPUs."""
