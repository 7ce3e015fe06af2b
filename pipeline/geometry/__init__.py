"""Geometry that several rooms share."""
