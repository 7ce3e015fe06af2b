"""Checks that the true geometry of every random arena must pass."""

from collections.abc import Iterator, Mapping
from itertools import chain

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Places
from pipeline.labels import Label
from pipeline.sensor import XTION
from sarsim.ground_truth.true_surface import CELL, FreeGround, Survey
from sarsim.victims.victims import TrueVictim, victims_of

CAMERA_HEIGHT = 0.6  # m above the ground
MIN_ELEVATION, MAX_ELEVATION = np.deg2rad(-34.5), np.deg2rad(10.5)
"""rad, elevation angles of the image's lower and upper edges."""
MIN_VISIBLE_FRACTION = 0.2  # Fraction of a victim's geoms that the camera must see from one position
GROUND_LABELS = (Label.TERRAIN, Label.STRAIGHT_RAMP, Label.INCLINED_RAMP)
MIN_PIECE_AREA = 0.1  # m²; smaller pieces of ground are ignored
VIEW_SPACING = 4  # cells, spacing of the camera positions that are tried


def failed_checks(mjcf: str, files: Mapping[str, bytes] | None = None) -> Iterator[str]:
    """Yield a description of each check that an arena fails, as soon as the check is complete.

    An arena passes if

    - its start is free,
    - drivable ground connects all ground on which a P3-AT can stand, and
    - a camera at the height of the P3-AT's camera can see every victim from this ground.

    Args:
        mjcf: MJCF of the arena, with a site ``start``.
        files: contents of the files to which the MJCF refers, by name.
    """
    model = mujoco.MjModel.from_xml_string(mjcf, files)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    survey = Survey(model, data)
    start = data.site("start").xpos
    ground = survey.ground_from(start)
    piece = 0 if ground is None else int(ground.pieces[tuple(ground.grid.cell_of(start))])
    if ground is None or not piece:
        yield "the start is blocked"
        return
    yield from (f"{area:.2f} m² of ground cannot be reached" for area in _unreachable_areas(survey, ground, piece))
    places = _camera_positions(ground, ground.pieces == piece)
    for victim in victims_of(model, data):
        if not is_visible(model, data, victim, places):
            yield f"victim {victim.id} is hidden"


def _unreachable_areas(survey: Survey, ground: FreeGround, piece: int) -> Iterator[float]:
    """Yield the area, m², of each piece of ground that does not contain the start and exceeds ``MIN_PIECE_AREA``."""
    beside = np.where(ground.pieces == piece, 0, ground.pieces)
    grounds = (apart for label in GROUND_LABELS for apart in survey.grounds(label, MIN_PIECE_AREA))
    elsewhere = (g.pieces for g in grounds if not np.array_equal(g.height, ground.height, equal_nan=True))
    for pieces in chain([beside], elsewhere):
        areas = np.bincount(pieces.ravel())[1:] * CELL**2
        yield from areas[areas > MIN_PIECE_AREA].tolist()


def _camera_positions(ground: FreeGround, drivable: NDArray[np.bool_]) -> Places:
    """(N, 3) m, camera positions above drivable ground, at intervals of ``VIEW_SPACING`` cells."""
    cells = np.argwhere(drivable)
    cells = cells[(cells % VIEW_SPACING == 0).all(axis=1)]
    return np.column_stack([ground.grid.centre_of(cells), ground.height[tuple(cells.T)] + CAMERA_HEIGHT])


def is_visible(model: mujoco.MjModel, data: mujoco.MjData, victim: TrueVictim, places: NDArray[np.float64]) -> bool:
    """Whether one of the ``places`` (N, 3) m shows at least ``MIN_VISIBLE_FRACTION`` of a victim's geoms."""
    parts = data.geom_xpos[victim.geoms]
    distance = np.linalg.norm(places - parts.mean(axis=0), axis=1)
    in_range = (distance >= XTION.nearest) & (distance <= XTION.farthest)
    near = places[in_range]
    order = np.argsort(np.round(distance[in_range], 3), kind="stable")
    own = set(victim.geoms.tolist())
    return any(_visible_fraction(model, data, place, parts, own) >= MIN_VISIBLE_FRACTION for place in near[order])


def _visible_fraction(
    model: mujoco.MjModel, data: mujoco.MjData, place: NDArray[np.float64], parts: NDArray[np.float64], own: set[int]
) -> float:
    """Fraction of the geoms ``own``, with centres ``parts`` (N, 3) m, that a camera at ``place`` (3,) m sees."""
    rays = parts - place
    elevation = np.arctan2(rays[:, 2], np.linalg.norm(rays[:, :2], axis=1))
    geom = np.full(len(parts), -1, np.int32)
    distance = np.full(len(parts), -1.0)
    flat = np.ascontiguousarray(rays).ravel()
    mujoco.mj_multiRay(model, data, place, flat, None, 1, -1, geom, distance, None, len(parts), 10.0)
    seen = (elevation >= MIN_ELEVATION) & (elevation <= MAX_ELEVATION) & np.isin(geom, list(own))
    return float(seen.mean())
