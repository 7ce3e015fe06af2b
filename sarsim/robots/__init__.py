"""Robots: their bodies and drives."""
