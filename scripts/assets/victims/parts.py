"""A body cut along the hems of its clothes into roughly convex parts."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from scripts.assets.victims.surface import ANKLE, HIP, KNEE, Points, Surface

SLEEVE, WRIST, COLLAR, WAIST = 0.40, 0.845, 0.515, 0.0
"""At rest, m: distance from x = 0 of a short sleeve's end and of the wrist; height of the collar and of the waist."""
BELLY = 0.13  # Height of the top of the belly at rest, m
HEM, CUFF = 0.62, 0.95  # Fraction of the thigh that short trousers cover, and of the shin above the shoe


def cut_into_parts(body: Surface) -> tuple[Surface, NDArray[np.int64], tuple[str, ...]]:
    """The body with edges along all hems, the index of each face's part, and the names of the parts."""
    for hem in (_sleeve, _wrist, _collar, _waist, _hem, _cuff):
        body = _cut(body, hem)
    centre = body.vertices[body.faces].mean(axis=1)
    share = body.weights[body.faces].mean(axis=1)
    names = [_part(place, body.bones[bone]) for place, bone in zip(centre, share.argmax(axis=1), strict=True)]
    parts = tuple(sorted(set(names)))
    return body, np.array([parts.index(name) for name in names]), parts


def _part(place: NDArray[np.float64], bone: str) -> str:
    """The part to which a face belongs, given its position at rest and the bone with the largest weight."""
    side = "left" if place[0] > 0 else "right"
    if _is_arm(place):
        if abs(place[0]) > WRIST:
            return f"{side}_hand"
        if abs(place[0]) < SLEEVE:
            return f"{side}_sleeve" if bone.endswith("humerus") else "chest"
        return f"{side}_upper_arm" if bone.endswith("humerus") else f"{side}_forearm"
    if _is_leg(place):
        thigh, shin = _along(place, HIP, KNEE), _along(place, KNEE, ANKLE)
        if shin > CUFF:
            return f"{side}_foot"
        if bone.endswith("femur"):
            return f"{side}_thigh" if thigh < HEM else f"{side}_knee"
        return f"{side}_shin" if thigh > HEM else "hips"
    if _collar(place) > 0:
        return "head"
    if _waist(place) < 0:
        return "hips"
    return "belly" if place[1] < BELLY else "chest"


def _is_arm(points: Points) -> NDArray[np.bool_]:
    return (np.abs(points[..., 0]) > 0.2) & (points[..., 1] > 0.3)


def _is_leg(points: Points) -> NDArray[np.bool_]:
    return points[..., 1] < -0.1


def _along(points: Points, start: Points, end: Points) -> NDArray[np.float64]:
    """Position along a limb on either side of the body, 0 at its start and 1 at its end."""
    x = np.concatenate([np.abs(points[..., :1]), points[..., 1:]], axis=-1)
    return (x - start) @ (end - start) / np.sum((end - start) ** 2)


def _sleeve(points: Points) -> NDArray[np.float64]:
    return np.where(_is_arm(points), np.abs(points[..., 0]) - SLEEVE, 1)


def _wrist(points: Points) -> NDArray[np.float64]:
    return np.where(_is_arm(points), np.abs(points[..., 0]) - WRIST, 1)


def _collar(points: Points) -> NDArray[np.float64]:
    """Signed height above the collar, which is lower at the front than at the back; the shoulders are below it."""
    x, y, z = np.abs(points[..., 0]), points[..., 1], points[..., 2]
    height = y - COLLAR - 0.02 - 0.35 * -z - 0.6 * np.maximum(x - 0.05, 0)
    return np.where(x < 0.19, height, np.where(y > 0.62, 1, -1))


def _waist(points: Points) -> NDArray[np.float64]:
    up = points[..., 1] - WAIST
    return np.where(np.abs(up) < 0.1, up, np.sign(up))


def _hem(points: Points) -> NDArray[np.float64]:
    return np.where(_is_leg(points), _along(points, HIP, KNEE) - HEM, -1)


def _cuff(points: Points) -> NDArray[np.float64]:
    return np.where(_is_leg(points), _along(points, KNEE, ANKLE) - CUFF, -1)


def _cut(body: Surface, value: Callable[[Points], NDArray[np.float64]]) -> Surface:
    """Split the faces that the line ``value`` = 0 crosses; vertices very close to the line count as lying on it."""
    values = value(body.vertices)
    values[np.abs(values) < 0.004] = 0
    vertices, weights = list(body.vertices), list(body.weights)
    middles: dict[tuple[int, int], int] = {}

    def crossing(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in middles:
            t = values[key[0]] / (values[key[0]] - values[key[1]])
            middles[key] = len(vertices)
            vertices.append((1 - t) * vertices[key[0]] + t * vertices[key[1]])
            weights.append((1 - t) * weights[key[0]] + t * weights[key[1]])
        return middles[key]

    faces = []
    for face in body.faces:
        signs = np.sign(values[face])
        if signs.min() >= 0 or signs.max() <= 0 or np.ptp(values[face]) > 0.5:
            faces.append(tuple(face))
            continue
        faces += _split([int(v) for v in face], signs, crossing)
    return Surface(np.array(vertices), np.array(faces), np.array(weights), body.bones)


def _split(
    face: list[int], signs: NDArray[np.float64], crossing: Callable[[int, int], int]
) -> list[tuple[int, int, int]]:
    """The triangles into which the line divides a face that has corners on both sides of it."""
    sides: dict[int, list[int]] = {-1: [], 1: []}
    for n in range(3):
        here, there = face[n], face[(n + 1) % 3]
        for side in (-1, 1):
            if signs[n] in (side, 0):
                sides[side].append(here)
        if signs[n] * signs[(n + 1) % 3] < 0:
            new = crossing(here, there)
            sides[-1].append(new)
            sides[1].append(new)
    return [(s[0], s[n], s[n + 1]) for s in sides.values() for n in range(1, len(s) - 1)]
