"""Victims as Rerun draws them: in the camera's image, on the map, and their photos; lengths in m."""

from collections.abc import Sequence
from math import ceil, sqrt

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.rerun.drawings import colour_image
from pipeline.victims.detection.detection import Detection
from pipeline.victims.display_ids import confirmed_ids, unconfirmed_ids
from pipeline.victims.observation import Refusal
from pipeline.victims.victim_map import Victim, Victims

CONFIRMED, UNCONFIRMED, REFUSED = (40, 220, 90), (255, 170, 40), (160, 160, 160)  # RGB
CERTAIN = np.sqrt(7.815)
"""Half axes of the 95 % ellipsoid, in standard deviations: χ² of three degrees of freedom."""
PHOTO, SHEET = (220, 240), (660, 804)
"""Width and height in pixels of a photo and of every sheet: the viewer takes JPEGs of one entity for a video."""
CAPTION_HEIGHT = 28  # Pixels below a photo
BACKGROUND = 38  # Grey level behind the photos


def detections(found: Sequence[Detection], refusals: Sequence[Refusal]) -> rr.Boxes2D:
    """The detections' boxes of one keyframe, with the reasons why some were refused."""
    reasons = {id(refusal.detection): refusal.reason for refusal in refusals}
    refused = [reasons.get(id(detection)) for detection in found]
    labels = [f"{d.confidence:.0%}{f': {why}' if why else ''}" for d, why in zip(found, refused, strict=True)]
    return rr.Boxes2D(
        array=np.array([detection.box for detection in found]).reshape(-1, 4),
        array_format=rr.Box2DFormat.XYXY,
        labels=labels,
        colors=[REFUSED if why else CONFIRMED for why in refused],
    )


def boxes(victims: Victims) -> rr.Boxes3D:
    """A box around the points of each victim."""
    everyone = _displayed(victims)
    corners = np.array([[v.points.min(axis=0), v.points.max(axis=0)] for _, v in everyone]).reshape(-1, 2, 3)
    return rr.Boxes3D(
        mins=corners[:, 0],
        sizes=corners[:, 1] - corners[:, 0],
        labels=[f"{_name(id)}, {victim.confidence:.0%}" for id, victim in everyone],
        colors=[_colour(id) for id, _ in everyone],
        radii=0.012,
        show_labels=True,
    )


def certainty(victims: Victims) -> rr.Ellipsoids3D:
    """The ellipsoid that contains each victim with a probability of 95 %."""
    everyone = _displayed(victims)
    values, vectors = np.linalg.eigh(np.array([v.covariance for _, v in everyone]).reshape(-1, 3, 3))
    # Eigenvectors may form a left-handed frame, which is not a rotation.
    vectors[..., 0] *= np.sign(np.linalg.det(vectors))[:, None]
    return rr.Ellipsoids3D(
        centers=np.array([v.position for _, v in everyone]).reshape(-1, 3),
        half_sizes=CERTAIN * np.sqrt(values),
        quaternions=Rotation.from_matrix(vectors).as_quat() if everyone else np.zeros((0, 4)),
        colors=[(*_colour(id), 60) for id, _ in everyone],
        fill_mode="majorwireframe",
    )


def ways(strips: Sequence[NDArray[np.float64]]) -> rr.LineStrips3D:
    """Paths of (N, 3) points each, m, from the entrance to the victims."""
    return rr.LineStrips3D([strip + np.array([0, 0, 0.1]) for strip in strips], colors=CONFIRMED, radii=0.02)


def photo_sheet(victims: Victims) -> rr.EncodedImage:
    """The victims' photos with their display ids, row by row, as many in a row as there are rows."""
    cells = [_photo(f"{_name(id)}  {v.confidence:.0%}", v.photo, _colour(id)) for id, v in _displayed(victims)]
    side = ceil(sqrt(len(cells))) or 1
    width, height = PHOTO[0], PHOTO[1] + CAPTION_HEIGHT
    sheet = np.full((side * height, side * width, 3), BACKGROUND, np.uint8)
    for k, cell in enumerate(cells):
        i, j = divmod(k, side)
        sheet[i * height : (i + 1) * height, j * width : (j + 1) * width] = cell
    return colour_image(cv2.resize(sheet, SHEET, interpolation=cv2.INTER_AREA).astype(np.uint8))


def _photo(text: str, photo: NDArray[np.uint8], colour: tuple[int, int, int]) -> NDArray[np.uint8]:
    """A photo, scaled to fit its place, above its caption."""
    width, height = PHOTO
    cell = np.full((height + CAPTION_HEIGHT, width, 3), BACKGROUND, np.uint8)
    scale = min((width - 8) / photo.shape[1], (height - 8) / photo.shape[0])
    size = [max(1, int(side * scale)) for side in photo.shape[1::-1]]
    left, top = (width - size[0]) // 2, (height - size[1]) // 2
    cell[top : top + size[1], left : left + size[0]] = cv2.resize(photo, size, interpolation=cv2.INTER_CUBIC)
    cv2.putText(cell, text, (8, height + 19), cv2.FONT_HERSHEY_SIMPLEX, 0.55, colour, 1, cv2.LINE_AA)
    return cell


def _displayed(victims: Victims) -> list[tuple[str, Victim]]:
    """The victims with their display ids, the confirmed ones first."""
    return confirmed_ids(victims) + unconfirmed_ids(victims)


def _name(display_id: str) -> str:
    return f"person {display_id}" if display_id.isdigit() else f"sighting {display_id}"


def _colour(display_id: str) -> tuple[int, int, int]:
    return CONFIRMED if display_id.isdigit() else UNCONFIRMED
