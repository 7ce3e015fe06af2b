"""The true world: its surfaces, its geoms as triangles, its columns of air and matter, and contacts."""
