"""Drawings of victims for Rerun: in the camera's image, on the map, and as photos; lengths in m."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
from PIL import ImageColor
from scipy.spatial.transform import Rotation

from pipeline.arrays import Places
from pipeline.labels import PERSON_COLOUR
from pipeline.rerun.drawings import ABOVE_GROUND, LINE_RADIUS, Colour, sheet
from pipeline.tracks.track import Track
from pipeline.tracks.tracks import Tracks
from pipeline.victims.detection import Detection
from pipeline.victims.display import confirmed_with_ids, ellipsoids, unconfirmed_with_ids
from pipeline.victims.observation import Refusal

CONFIRMED, UNCONFIRMED, REFUSED = map(ImageColor.getrgb, (PERSON_COLOUR, "palegreen", "darkgray"))
BOX_MARGIN = 0.15  # Margin of the box drawn around a person, m, so that the box is visible from afar


def detections(found: Sequence[Detection], refusals: Sequence[Refusal]) -> rr.Boxes2D:
    """The boxes of a keyframe's detections, labelled with their confidences and any reasons for rejection."""
    reasons = {id(refusal.detection): refusal.reason for refusal in refusals}
    refused = [reasons.get(id(detection)) for detection in found]
    labels = [f"{d.confidence:.0%}{f': {why}' if why else ''}" for d, why in zip(found, refused, strict=True)]
    return rr.Boxes2D(
        array=np.array([detection.box for detection in found]).reshape(-1, 4),
        array_format=rr.Box2DFormat.XYXY,
        labels=labels,
        colors=[REFUSED if why else CONFIRMED for why in refused],
    )


def boxes(victims: Tracks) -> rr.Boxes3D:
    """A box around each victim's points, with a margin of ``BOX_MARGIN`` on every side."""
    everyone = _displayed(victims)
    corners = np.array([[v.points.min(axis=0), v.points.max(axis=0)] for _, v in everyone]).reshape(-1, 2, 3)
    return rr.Boxes3D(
        mins=corners[:, 0] - BOX_MARGIN,
        sizes=corners[:, 1] - corners[:, 0] + 2 * BOX_MARGIN,
        labels=[f"{_name(id)}, {victim.confidence:.0%}" for id, victim in everyone],
        colors=[_colour(id) for id, _ in everyone],
        radii=2 * LINE_RADIUS,
        fill_mode="transparentfillmajorwireframe",
        show_labels=True,
    )


def confidence_ellipsoids(victims: Tracks) -> rr.Ellipsoids3D:
    """For each victim, the ellipsoid that contains the victim's position with a probability of 95%."""
    everyone = _displayed(victims)
    half_axes, vectors = ellipsoids(np.array([v.covariance for _, v in everyone]).reshape(-1, 3, 3))
    # Eigenvectors may form a left-handed frame, which is not a rotation.
    vectors[..., 0] *= np.sign(np.linalg.det(vectors))[:, None]
    return rr.Ellipsoids3D(
        centers=np.array([v.position for _, v in everyone]).reshape(-1, 3),
        half_sizes=half_axes,
        quaternions=Rotation.from_matrix(vectors).as_quat() if everyone else np.zeros((0, 4)),
        colors=[_colour(id) for id, _ in everyone],
        fill_mode="majorwireframe",
    )


def paths(strips: Sequence[Places]) -> rr.LineStrips3D:
    """Paths from the entrance to the victims."""
    return rr.LineStrips3D([strip + 2 * ABOVE_GROUND for strip in strips], colors=CONFIRMED, radii=LINE_RADIUS)


def photo_sheet(victims: Tracks, side: int) -> rr.EncodedImage:
    """A sheet with the victims' photos and display ids; see :func:`sheet` for ``side``."""
    photos = [(f"{_name(id)}  {v.confidence:.0%}", v.photo, _colour(id)) for id, v in _displayed(victims)]
    return sheet(photos, side)


def _displayed(victims: Tracks) -> list[tuple[str, Track]]:
    """The victims with their display ids, the confirmed victims first."""
    return confirmed_with_ids(victims) + unconfirmed_with_ids(victims)


def _name(display_id: str) -> str:
    return f"person {display_id}" if display_id.isdigit() else f"sighting {display_id}"


def _colour(display_id: str) -> Colour:
    return CONFIRMED if display_id.isdigit() else UNCONFIRMED
