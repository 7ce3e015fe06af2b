"""The looks of the 2D map by the rules 2026D of the Rescue Robot League, from a summary of them."""

MAP_COLOURS = {
    "file_name": (0, 44, 207),
    "scale": (0, 50, 140),  # and axes
    "light": (237, 237, 238),  # unexplored: the two greys are hector_geotiff's, the rules say light and dark grey
    "dark": (226, 226, 227),
    "grid": (0, 0, 0),  # of explored ground
    "start": (0, 240, 0),
    "walls": (0, 40, 120),
    "searched": (128, 128, 128),  # with least confidence; with most: text
    "text": (255, 255, 255),
    "ar_code": (255, 200, 0),
    "hazmat_sign": (255, 100, 30),
    "real_object": (240, 10, 10),
    "path": (120, 0, 140),
}
"""RGB by element."""
LENGTHS = {
    "pixel": 0.01,  # the thinnest line
    "checker": 1.0,
    "grid": 0.5,
    "scale": 1.0,
    "axis": 0.5,
    "disc": 0.35,
    "diamond": 0.3,
    "path": 0.02,
    "margin": 1.0,  # around the searched ground; an assumption, as are the next two
    "title": 0.2,  # height of letters
    "arrow": 0.5,  # of the start
}
"""m, by element."""


def pixels(element: str, share: float = 1.0) -> int:
    """Whole pixels of a ``share`` of an element's length, at least one."""
    return max(1, round(share * LENGTHS[element] / LENGTHS["pixel"]))
