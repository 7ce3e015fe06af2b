"""DGCNN hand-written for CPUs: inference, and the gradients of a training step."""
