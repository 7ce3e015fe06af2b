"""Ground truth: the drivable surface, plane faces, geoms as triangles, columns of bodies, and contacts."""
