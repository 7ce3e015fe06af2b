"""Geometry shared by several packages."""
