"""DGCNN by hand for CPUs: inference, and the gradients of a training step."""
