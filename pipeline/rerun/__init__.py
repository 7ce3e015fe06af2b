"""The robot's knowledge, step by step, in Rerun."""
