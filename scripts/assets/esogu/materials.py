"""Colours and textures of the building and its furniture."""

TEXTURES = (
    # 2d textures lie in the plane of a geom's x and y: right for floors.
    {"name": "floor_tiles", "rgb1": "0.62 0.63 0.64", "mark": "edge", "markrgb": "0.48 0.49 0.50"},
)
TILES_PER_METRE = "3.3333 3.3333"
COLOURS = {
    "plaster": (0.87, 0.86, 0.81), "column": (0.76, 0.76, 0.74), "frame": (0.93, 0.93, 0.93),
    "glass": (0.66, 0.79, 0.88), "door": (0.58, 0.39, 0.22), "door_frame": (0.44, 0.29, 0.17),
    "cabinet": (0.20, 0.36, 0.60), "cabinet_door": (0.25, 0.43, 0.68), "locker_door": (0.42, 0.52, 0.60),
    "worktop": (0.80, 0.80, 0.78), "wood": (0.74, 0.58, 0.38), "dark_wood": (0.46, 0.31, 0.19),
    "steel": (0.55, 0.57, 0.59), "grey": (0.66, 0.68, 0.68), "instrument": (0.86, 0.85, 0.79),
    "screen": (0.10, 0.16, 0.20), "fabric": (0.18, 0.22, 0.32), "concrete": (0.56, 0.55, 0.53),
    "motor": (0.20, 0.45, 0.35), "generator": (0.24, 0.35, 0.55), "cork": (0.66, 0.48, 0.30),
    "terracotta": (0.66, 0.34, 0.22), "leaf": (0.20, 0.44, 0.18), "book_red": (0.56, 0.17, 0.15),
    "book_blue": (0.20, 0.29, 0.50),
}  # fmt: skip
"""Of materials; they stand for those of the element library of the same name."""
