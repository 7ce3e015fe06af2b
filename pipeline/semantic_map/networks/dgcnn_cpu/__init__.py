"""DGCNN made fast on a CPU: inference, and a training step with hand-written gradients."""
