"""Geometry that several packages share."""
