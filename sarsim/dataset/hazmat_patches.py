"""Training patches for the hazmat sign classifier: rectified signs among clutter, and squares that resemble signs."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.finds.config import SquaresConfig
from pipeline.finds.hazmat import SIGN_SIDE
from pipeline.finds.hazmat_classes import HAZMAT_CLASSES
from pipeline.finds.quads import find_quads
from pipeline.finds.squares import corners_in
from sarsim.arenas.things.codes import qr_picture, tag_picture
from sarsim.arenas.things.hazmat import SignStyle, sign_face
from sarsim.dataset.hazmat_labels import draw_varied

SPAN = 3 * SIGN_SIDE // 2  # Pixels along a label in a scene of 3 × 3 cells; the label to learn is in the middle
NO_SIGN, FOUND = 0.4, 0.4  # Share of patches without a sign, and share of those that show squares found in pictures
MOST_MARGIN = 0.08  # Widest white margin of a printed label, as a share of its side
UNCERTAIN = 0.04  # Standard deviation of a corner's position, as a share of the side
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
Picture = NDArray[np.uint8]
Placed = tuple[Picture, NDArray[np.float32]]  # A picture, and the (4, 2) corners of a square in it


def label_square(name: str, rng: np.random.Generator) -> Picture:
    """A random print of a label, (SPAN, SPAN, 3) uint8, its top corner at the top left; some have a white margin."""
    margin = int(SPAN * rng.choice([0, rng.uniform(0, MOST_MARGIN)]))
    side = SPAN - 2 * margin
    # Drawn by two programs, so that the classifier learns the sign and not the drawing style.
    face = (
        sign_face(name, side, SignStyle.random(rng))
        if rng.random() < 0.5
        else _turned(draw_varied(name, 2 * side, rng))
    )
    return np.pad(face, ((margin,) * 2, (margin,) * 2, (0, 0)), constant_values=255)


def _turned(upright: Picture) -> Picture:
    """A diamond turned into a square of half the image's side; its top corner becomes the top left one."""
    side = len(upright) // 2
    diamond = np.array([[1, 0], [2, 1], [1, 2], [0, 1]], np.float32) * side
    T = cv2.getPerspectiveTransform(diamond, SQUARE * side)
    return np.asarray(cv2.warpPerspective(upright, T, (side, side)), np.uint8)


@dataclass(frozen=True)
class PatchSource:
    """The material from which patches are made.

    Attributes:
        squares: for each class, (N, SPAN, SPAN, 3) uint8 labels from :func:`label_square`.
        backgrounds: pictures without signs.
        others: squares found in ``backgrounds``, none of which is a sign.
    """

    squares: Sequence[NDArray[np.uint8]]
    backgrounds: Sequence[Picture]
    others: Sequence[Placed]

    @classmethod
    def make(cls, each: int, backgrounds: Sequence[Picture], rng: np.random.Generator) -> "PatchSource":
        """A source with ``each`` labels of every class, and with the squares found in the backgrounds."""
        config = SquaresConfig()
        squares = [np.stack([label_square(name, rng) for _ in range(each)]) for name in HAZMAT_CLASSES]
        others = [(image, quad) for image in backgrounds for quad in find_quads(image, config)]
        return cls(squares, backgrounds, others)

    def one(self, kind: int, rng: np.random.Generator) -> Picture:
        """A random label of class ``kind``."""
        return np.asarray(self.squares[kind][rng.integers(len(self.squares[kind]))])


def patches(source: PatchSource, count: int, rng: np.random.Generator) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """``count`` random patches and their classes.

    Returns:
        (count, SIGN_SIDE, SIGN_SIDE, 3) uint8, and (count,) int64 classes; ``len(HAZMAT_CLASSES)`` means no sign.
    """
    made = [_patch(source, rng) for _ in range(count)]
    return np.stack([image for image, _ in made]), np.array([kind for _, kind in made], np.int64)


def _patch(source: PatchSource, rng: np.random.Generator) -> tuple[Picture, int]:
    kind = len(HAZMAT_CLASSES) if rng.random() < NO_SIGN else int(rng.integers(len(HAZMAT_CLASSES)))
    if kind < len(HAZMAT_CLASSES):
        scene, quad = _scene(source, rng), SPAN + SPAN * SQUARE
        scene[SPAN : 2 * SPAN, SPAN : 2 * SPAN] = _worn(source.one(kind, rng), rng)
    elif source.others and rng.random() < FOUND:
        scene, quad = source.others[int(rng.integers(len(source.others)))]
    else:
        scene = _scene(source, rng)
        quad = _no_sign(scene, source, rng)
    side = np.linalg.norm(quad[1] - quad[0])
    quad = quad + rng.normal(0, UNCERTAIN * side, (4, 2)).astype(np.float32)
    return photographed(_rectified(scene, quad, rng), rng), kind


def _no_sign(scene: Picture, source: PatchSource, rng: np.random.Generator) -> NDArray[np.float32]:
    """Corners of a square in a scene that is not a sign: it shows no sign, a part of one, or several."""
    draw = rng.random()
    if draw < 0.2:
        return _block(scene, source, rng)
    if draw < 0.35:  # a part of a sign, or a sign with wide surroundings
        scene[SPAN : 2 * SPAN, SPAN : 2 * SPAN] = source.one(int(rng.integers(len(HAZMAT_CLASSES))), rng)
        size = SPAN * rng.choice([rng.uniform(0.35, 0.6), rng.uniform(1.7, 2.2), rng.uniform(0.8, 1.2)])
        middle = 1.5 * SPAN + rng.uniform(-0.5, 0.5, 2) * (2.9 * SPAN - size) * 0.5
        while _overlap(middle, size) > 0.35:
            middle = rng.uniform(size / 2, 3 * SPAN - size / 2, 2)
            size = min(size, SPAN)
        return (middle + (SQUARE - 0.5) * size).astype(np.float32)
    if draw < 0.7:
        scene[SPAN : 2 * SPAN, SPAN : 2 * SPAN] = _worn(_thing(rng), rng)
    elif draw < 0.75:
        scene[:] = _thing(rng, 3 * SPAN)
    turn = rng.uniform(0, np.pi / 2) * (draw >= 0.7)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return (1.5 * SPAN + (SQUARE - 0.5) @ R.T * SPAN).astype(np.float32)


def _block(scene: Picture, source: PatchSource, rng: np.random.Generator) -> NDArray[np.float32]:
    """Corners of a block of two or four signs side by side, which counts as no sign."""
    shape = ((2, 2), (1, 2), (2, 1))[int(rng.integers(3))]
    for i, j in np.ndindex(*shape):
        sign = np.rot90(source.one(int(rng.integers(len(HAZMAT_CLASSES))), rng), int(rng.integers(4)))
        scene[i * SPAN : (i + 1) * SPAN, j * SPAN : (j + 1) * SPAN] = sign
    return (SQUARE * shape[::-1] * SPAN).astype(np.float32)


def _overlap(middle: NDArray[np.float64], size: float) -> float:
    """Intersection over union of a square and the middle cell."""
    sides = np.minimum(middle + size / 2, 2 * SPAN) - np.maximum(middle - size / 2, SPAN)
    common = float(np.prod(np.clip(sides, 0, None)))
    return common / (size**2 + SPAN**2 - common)


def _scene(source: PatchSource, rng: np.random.Generator) -> Picture:
    """A background, (3 SPAN, 3 SPAN, 3); in half of the scenes, some cells show signs or other objects."""
    scene = _background(source.backgrounds, rng)
    if rng.random() < 0.5:
        for i, j in np.ndindex(3, 3):
            if rng.random() < 0.6:
                other = source.one(int(rng.integers(len(HAZMAT_CLASSES))), rng) if rng.random() < 0.6 else _thing(rng)
                scene[i * SPAN : (i + 1) * SPAN, j * SPAN : (j + 1) * SPAN] = np.rot90(other, int(rng.integers(4)))
    return scene


def _background(backgrounds: Sequence[Picture], rng: np.random.Generator) -> Picture:
    """A part of a picture, noise of one scale, or a plain colour, (3 SPAN, 3 SPAN, 3)."""
    draw, size = rng.random(), 3 * SPAN
    if backgrounds and draw < 0.6:
        image = backgrounds[int(rng.integers(len(backgrounds)))]
        most = min(image.shape[:2])
        side = int(rng.integers(most // 4, most + 1))
        y, x = (int(rng.integers(n - side + 1)) for n in image.shape[:2])
        return np.asarray(cv2.resize(image[y : y + side, x : x + side], (size, size)), np.uint8)
    colour = rng.uniform(0, 255, 3)
    if draw < 0.7:
        return np.full((size, size, 3), colour, np.uint8)
    grain = int(rng.integers(2, 80))
    noise = rng.normal(0, rng.uniform(5, 60), (grain, int(rng.integers(2, 80)), 1))
    return np.clip(colour + cv2.resize(noise, (size, size))[..., None], 0, 255).astype(np.uint8)


def _thing(rng: np.random.Generator, size: int = SPAN) -> Picture:
    """A square object other than a hazmat sign, (size, size, 3): a tag, a code, an eye chart, or words and shapes."""
    ground, ink = rng.integers(0, 256, (2, 3)).tolist()
    if rng.random() < 0.4:
        ground = [int(rng.integers(200, 256))] * 3
    image = np.full((size, size, 3), ground, np.uint8)
    draw = rng.random()
    if draw < 0.15:
        tag = cv2.resize(tag_picture(int(rng.integers(587)), 4), (size, size), interpolation=cv2.INTER_NEAREST)
        return np.repeat(tag[..., None], 3, axis=2)
    if draw < 0.35:
        code = cv2.resize(qr_picture("0" * int(rng.integers(1, 99)), 4), (size, size), interpolation=cv2.INTER_AREA)
        first = int(rng.integers(size // 3))  # the code with its printed margin, or only a part of it
        return np.repeat(cv2.resize(code[first:, first:], (size, size))[..., None], 3, axis=2)
    if draw < 0.5:
        return _landolt(image, ink, rng)
    for _ in range(int(rng.integers(0, 6))):
        at, far = rng.integers(0, size, (2, 2)).tolist()
        thick = int(rng.choice([-1, 2, 6]))
        shape = rng.integers(4)
        if shape == 0:
            cv2.circle(image, at, int(rng.integers(5, size // 2)), ink, thick)
        elif shape == 1:
            cv2.rectangle(image, at, far, ink, thick)
        elif shape == 2:
            cv2.line(image, at, far, ink, abs(thick))
        else:
            word = "".join(rng.choice(list("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"), int(rng.integers(1, 9))))
            cv2.putText(image, word, at, cv2.FONT_HERSHEY_SIMPLEX, float(rng.uniform(0.4, 2)), ink, abs(thick))
        ink = rng.integers(0, 256, 3).tolist() if rng.random() < 0.3 else ink
    return image


def _landolt(image: Picture, ink: list[int], rng: np.random.Generator) -> Picture:
    """An eye chart of concentric Landolt Cs."""
    middle, radius = len(image) // 2, rng.uniform(0.3, 0.48) * len(image)
    while radius > 3:
        gap = float(rng.uniform(0, 360))
        thick = max(1, round(radius / 2.5))
        size = (round(radius - thick / 2),) * 2
        cv2.ellipse(image, (middle, middle), size, gap, 25, 335, ink, thick)
        radius *= rng.uniform(0.3, 0.5)
    return image


def _worn(label: Picture, rng: np.random.Generator) -> Picture:
    """A label, at times faded or partly hidden at a corner."""
    label = label.copy()  # It may be a view of the source, which must not wear
    if rng.random() < 0.25:
        corner = SQUARE[rng.integers(4)] * SPAN
        ends = corner + rng.normal(0, 0.35 * SPAN, (5, 2))
        cv2.fillConvexPoly(label, cv2.convexHull(ends.astype(np.int32)), rng.integers(0, 256, 3).tolist())
    if rng.random() < 0.2:
        pale = rng.uniform(0, 0.5)
        label = np.asarray(label * (1 - pale) + rng.integers(120, 256) * pale, np.uint8)
    return label


def _rectified(scene: Picture, quad: NDArray[np.float32], rng: np.random.Generator) -> Picture:
    """(SIGN_SIDE, SIGN_SIDE, 3) the rectified quadrilateral and its margin, any corner first, of random sharpness."""
    quad = np.roll(quad, int(rng.integers(4)), axis=0)
    side = int(np.exp(rng.uniform(np.log(24), np.log(SPAN))))
    T = cv2.getPerspectiveTransform(quad.astype(np.float32), corners_in(side))
    # Average over the scene's pixels that fall into one pixel of the patch, as a camera does.
    blur = float(np.linalg.norm(quad[1] - quad[0])) / side / 2
    soft = cv2.GaussianBlur(scene, (0, 0), max(0.3, blur)) if blur > 0.5 else scene
    patch = cv2.warpPerspective(soft, T, (side, side), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(patch, (SIGN_SIDE, SIGN_SIDE), interpolation=cv2.INTER_LINEAR), np.uint8)


def photographed(patch: Picture, rng: np.random.Generator) -> Picture:
    """A square patch (side, side, 3) as a camera sees it: with random blur, light, glare, compression and noise."""
    image = patch.astype(np.float32)
    for change in _changes():
        if rng.random() < 0.5:
            image = change(image, rng)
    return np.clip(image + rng.normal(0, rng.uniform(0, 12), image.shape), 0, 255).astype(np.uint8)


def _changes() -> Iterator[Callable[[NDArray[np.float32], np.random.Generator], NDArray[np.float32]]]:
    yield _blurred
    yield _moved
    yield _lit
    yield _contrasted
    yield _coloured
    yield _glaring
    yield _compressed


def _blurred(image: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), rng.uniform(0.3, 1.5)), np.float32)


def _coloured(image: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """With another white balance, and darker or paler."""
    factor = rng.uniform(0.75, 1.25, 3) * rng.uniform(0.3, 1.1)
    return np.asarray(image * factor + rng.uniform(-10, 25), np.float32)


def _contrasted(image: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """With another gamma."""
    return np.asarray(255 * (np.clip(image, 0, 255) / 255) ** np.exp(rng.normal(0, 0.4)), np.float32)


def _moved(image: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """With motion blur in a random direction, over at most four pixels."""
    kernel = np.zeros((7, 7), np.float32)
    end = 3 + 3 * np.array([np.cos(a := rng.uniform(0, np.pi)), np.sin(a)]) * rng.uniform(0.3, 1)
    cv2.line(kernel, (3, 3), np.round(end).astype(int).tolist(), 1)
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum()), np.float32)


def _lit(image: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """With uneven lighting."""
    light = cv2.resize(rng.uniform(0.4, 1.2, (2, 2)), image.shape[:2])[..., None]
    return np.asarray(image * light, np.float32)


def _glaring(image: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """With the reflection of a lamp, as behind glass."""
    side = len(image)
    glare = np.zeros((side, side), np.float32)
    axes = rng.integers(side // 20, side // 3, 2).tolist()
    cv2.ellipse(glare, rng.integers(0, side, 2).tolist(), axes, float(rng.uniform(0, 180)), 0, 360, 1.0, -1)
    soft = cv2.GaussianBlur(glare, (0, 0), rng.uniform(1, 6))[..., None]
    return np.asarray(image + (255 - image) * soft * rng.uniform(0.1, 0.8), np.float32)


def _compressed(image: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """With the artefacts of JPEG at low quality."""
    quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(25, 90))]
    _, data = cv2.imencode(".jpg", np.clip(image, 0, 255).astype(np.uint8), quality)
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.float32)
