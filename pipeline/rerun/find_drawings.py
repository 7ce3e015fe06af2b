"""Drawings of finds for Rerun: in the camera's image, on the map, and as photos; lengths in m."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
from PIL import ImageColor

from pipeline.rerun.drawings import MARK_RADIUS, sheet
from pipeline.tracks.find import Find, Reading, plain_text

FIND_COLOUR = ImageColor.getrgb("#ff641e")  # as in the rescue report


def marks(finds: Sequence[Find]) -> rr.Points3D:
    """A labelled point for each find except people's heat, whose points would hide the people's boxes and names."""
    shown = [find for find in finds if not find.is_heat_of_person]
    return rr.Points3D(
        np.array([find.position for find in shown]).reshape(-1, 3),
        labels=[_name(find) for find in shown],
        colors=FIND_COLOUR,
        radii=MARK_RADIUS,
        show_labels=True,
    )


def photo_sheet(finds: Sequence[Find], side: int) -> rr.EncodedImage:
    """A sheet with the photos of all finds; see :func:`sheet` for ``side``."""
    return sheet([(f"{k} {_name(find)}", find.photo, FIND_COLOUR) for k, find in enumerate(finds, start=1)], side)


def outlines(readings: Sequence[Reading]) -> rr.LineStrips2D:
    """The outlines of readings in the camera's image, each labelled with the reading's text or kind."""
    return rr.LineStrips2D(
        [np.vstack([reading.corners, reading.corners[:1]]) for reading in readings],
        labels=[plain_text(reading.text or reading.kind) for reading in readings],
        colors=FIND_COLOUR,
    )


def _name(find: Find) -> str:
    return plain_text(f"{find.kind.replace('_', ' ')} {find.text}".rstrip())
