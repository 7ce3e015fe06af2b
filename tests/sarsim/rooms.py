"""Small rooms as MJCF."""

WALL, TERRAIN = 1, 2
Interval = tuple[float, float]


def box(x: Interval, y: Interval, z: Interval = (0.0, 1.2), label: int = WALL) -> str:
    """An upright box."""
    pos = " ".join(f"{sum(side) / 2:g}" for side in (x, y, z))
    size = " ".join(f"{(side[1] - side[0]) / 2:g}" for side in (x, y, z))
    return f'<geom type="box" pos="{pos}" size="{size}" user="{label}"/>'


def movable(geom: str) -> str:
    """A geom on a mocap body, which a test can move."""
    return f'<body name="movable" mocap="true" pos="9 9 0">{geom}</body>'


def room(x: Interval, y: Interval, *more: str) -> str:
    """The MJCF of a room in which the robot starts at the origin, looking along x."""
    walls = [
        box((x[0] - 0.1, x[0]), y),
        box((x[1], x[1] + 0.1), y),
        box(x, (y[0] - 0.1, y[0])),
        box(x, (y[1], y[1] + 0.1)),
    ]
    floor = f'<site name="start"/><geom type="plane" size="20 20 1" user="{TERRAIN}"/>'
    content = "".join([floor, *walls, *more])
    return f'<mujoco><size nuser_geom="1"/><worldbody><light pos="0 0 3"/>{content}</worldbody></mujoco>'


HOUSE = room(
    (-1.3, 4.6), (-1.3, 1.9), box((1.6, 1.7), (-1.3, 0.3)), box((-1.3, -0.7), (1.2, 1.9)), box((3.2, 3.3), (0.7, 1.9))
)
"""Three rooms, which differ."""
