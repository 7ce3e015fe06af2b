"""The appearance of the 2D map according to a summary of the Rescue Robot League's rules 2026D."""

MAP_COLOURS = {
    "file_name": (0, 44, 207),
    "scale": (0, 50, 140),  # and the axes
    "light": (237, 237, 238),  # unexplored: the greys of hector_geotiff; the rules say only light and dark grey
    "dark": (226, 226, 227),
    "grid": (0, 0, 0),  # on explored ground
    "start": (0, 240, 0),
    "walls": (0, 40, 120),
    "searched": (128, 128, 128),  # at the lowest confidence; ``text`` at the highest
    "text": (255, 255, 255),
    "ar_code": (255, 200, 0),
    "hazmat_sign": (255, 100, 30),
    "real_object": (240, 10, 10),
    "path": (120, 0, 140),
}
"""RGB colour of each element."""
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
    "title": 0.2,  # height of its letters
    "arrow": 0.5,  # at the start
}
"""Length of each element, m."""


def pixels(element: str, fraction: float = 1.0) -> int:
    """A ``fraction`` of an element's length in whole pixels, at least one."""
    return max(1, round(fraction * LENGTHS[element] / LENGTHS["pixel"]))
