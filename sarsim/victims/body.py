"""A person of the library as MJCF: skin, hair, face, and clothes in random colours."""

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from pipeline.labels import Label
from sarsim.victims.mjcf import geom, numbers, quaternion
from sarsim.victims.people import Figure, Shape, vertex_normals

SKIN = (
    (0.95, 0.78, 0.66), (0.89, 0.69, 0.55), (0.80, 0.59, 0.44), (0.66, 0.46, 0.32), (0.48, 0.32, 0.22),
    (0.33, 0.22, 0.16),
)  # fmt: skip
HAIR = (
    (0.07, 0.06, 0.05), (0.16, 0.10, 0.06), (0.33, 0.20, 0.10), (0.55, 0.38, 0.18), (0.78, 0.66, 0.42),
    (0.55, 0.55, 0.56),
)  # fmt: skip
DARK_HAIR = (*HAIR[:2], HAIR[-1])
MEDIUM_SKIN_SUM = 1.7  # Sum of a skin's RGB values below which the hair is dark or grey
TOPS = (
    (0.75, 0.12, 0.12), (0.14, 0.28, 0.60), (0.10, 0.42, 0.22), (0.90, 0.74, 0.15), (0.90, 0.90, 0.88),
    (0.12, 0.12, 0.14), (0.50, 0.20, 0.50), (0.90, 0.45, 0.12), (0.35, 0.65, 0.80), (0.92, 0.60, 0.68),
    (0.45, 0.45, 0.47), (0.40, 0.26, 0.16),
)  # fmt: skip
BOTTOMS = (
    (0.14, 0.20, 0.36), (0.24, 0.33, 0.50), (0.11, 0.11, 0.12), (0.45, 0.38, 0.28), (0.35, 0.36, 0.37),
    (0.22, 0.27, 0.18), (0.70, 0.64, 0.52), (0.35, 0.13, 0.15),
)  # fmt: skip
SHOES = ((0.08, 0.07, 0.07), (0.30, 0.19, 0.11), (0.85, 0.85, 0.85), (0.60, 0.12, 0.12), (0.18, 0.24, 0.42))
PATTERN_PERIOD = {"stripes": 0.11, "bands": 0.24}  # Period of the stripes or bands, m
CHECK_SIZE, CLOTH_SIZE = 0.11, 0.4  # m, sides of the squares that textures of checks and of plain cloth cover
PATTERNS, PATTERN_PROBABILITIES = ("plain", "stripes", "checks"), (0.6, 0.25, 0.15)
"""Patterns of tops other than overalls, and their probabilities."""
REFLECTIVE = (0.92, 0.95, 0.35)
EYE, IRIS = (0.93, 0.92, 0.90), (0.12, 0.09, 0.07)
LIP_RATIOS = np.array((0.85, 0.55, 0.52))  # Ratios of the lips' RGB values to the skin's
SHORT_SLEEVE = ("left_sleeve", "right_sleeve", "chest", "belly")
LONG_SLEEVE = (*SHORT_SLEEVE, "left_upper_arm", "right_upper_arm", "left_forearm", "right_forearm")
SHORTS = ("hips", "left_thigh", "right_thigh")
TROUSERS = (*SHORTS, "left_knee", "right_knee", "left_shin", "right_shin")
FEET = ("left_foot", "right_foot")
UPPER_BODY = ("head", "chest", "left_sleeve", "right_sleeve")  # The parts of a bust


@dataclass(frozen=True)
class Outfit:
    """The appearance of a person.

    Attributes:
        skin, hair, top, bottom, shoes: RGB colours, 0 to 1.
        hair_style: short, long or bald.
        top_pattern: plain, stripes, checks, or bands (of reflective cloth).
        long_sleeves, long_legs: whether the clothes cover the whole arms and legs.
    """

    skin: tuple[float, ...]
    hair: tuple[float, ...]
    top: tuple[float, ...]
    bottom: tuple[float, ...]
    shoes: tuple[float, ...]
    hair_style: str
    top_pattern: str
    long_sleeves: bool
    long_legs: bool

    @classmethod
    def random(cls, build: str, rng: np.random.Generator) -> "Outfit":
        """A random outfit for a person of a given build; one adult in five wears overalls."""

        def one_of(colours: Sequence[tuple[float, ...]]) -> tuple[float, ...]:
            colour = np.array(colours[int(rng.integers(len(colours)))]) * rng.uniform(0.85, 1.1)
            return tuple(np.minimum(colour, 1))

        skin = one_of(SKIN)
        long_hair = rng.random() < {"woman": 0.8, "child": 0.5}.get(build, 0.08)
        bald = build in ("man", "stout") and rng.random() < 0.15
        top, overall = one_of(TOPS), build != "child" and rng.random() < 0.2
        return cls(
            skin=skin,
            hair=one_of(HAIR if sum(skin) > MEDIUM_SKIN_SUM else DARK_HAIR),
            top=top,
            bottom=top if overall else one_of(BOTTOMS),
            shoes=one_of(SHOES),
            hair_style="bald" if bald else "long" if long_hair else "short",
            top_pattern="bands" if overall else str(rng.choice(PATTERNS, p=PATTERN_PROBABILITIES)),
            long_sleeves=bool(overall or rng.random() < 0.5),
            long_legs=bool(overall or rng.random() < 0.75),
        )

    def material(self, part: str) -> str:
        """The name of the material of a part of the body."""
        if part in (LONG_SLEEVE if self.long_sleeves else SHORT_SLEEVE):
            return "top"
        if part in (TROUSERS if self.long_legs else SHORTS):
            return "bottom"
        return "shoes" if part in FEET else "skin"


def person_mjcf(name: str, figure: Figure, outfit: Outfit) -> tuple[list[Element], list[Element]]:
    """Assets and geoms of a person; the names of all assets and geoms start with ``name`` and ``_``."""
    assets, geoms = _materials(name, outfit), []
    normals = vertex_normals(figure.body)
    for number, part in enumerate(figure.parts):
        material = outfit.material(part)
        mesh, pattern = f"{name}_{part}", outfit.top_pattern if material == "top" else "plain"
        shape = Shape(figure.body.vertices, figure.body.faces[figure.face_parts == number])
        assets.append(_mesh(mesh, shape, normals, _texture_coordinates(figure.rest, part, pattern)))
        geoms.append(geom(mesh, Label.VICTIM, type="mesh", mesh=mesh, material=f"{name}_{material}"))
    if outfit.hair_style != "bald":
        hair = figure.hair[outfit.hair_style]
        assets.append(_mesh(f"{name}_hair", hair, vertex_normals(hair)))
        mesh = f"{name}_hair"
        geoms.append(geom(mesh, Label.VICTIM, type="mesh", mesh=mesh, material=mesh))
    return assets, geoms + _facial_features(name, figure)


def _materials(name: str, outfit: Outfit) -> list[Element]:
    """Materials and textures of a person; only the top and the bottom have textures."""
    bottom = {"builtin": "flat", "rgb1": numbers(outfit.bottom), "mark": "random", "random": "0.2"}
    bottom["markrgb"] = numbers(np.array(outfit.bottom) * 0.85)
    materials = []
    for cloth, size, pattern in (("top", "16", _pattern(outfit)), ("bottom", "64", bottom)):
        texture = f"{name}_{cloth}"
        materials += [
            Element("texture", {"type": "2d", "width": size, "height": size} | pattern, name=texture),
            Element("material", name=texture, texture=texture, specular="0.05", shininess="0.05"),
        ]
    colours = {"skin": outfit.skin, "hair": outfit.hair, "shoes": outfit.shoes}
    colours |= {"lips": tuple(LIP_RATIOS * outfit.skin), "eye": EYE, "iris": IRIS}
    return materials + [
        Element("material", name=f"{name}_{what}", rgba=numbers((*colour, 1)), specular="0.1", shininess="0.2")
        for what, colour in colours.items()
    ]


def _pattern(outfit: Outfit) -> dict[str, str]:
    """Attributes of the top's texture."""
    top = np.array(outfit.top)
    flat = {"builtin": "flat", "rgb1": numbers(top)}
    if outfit.top_pattern == "plain":
        return flat | {"mark": "random", "markrgb": numbers(top * 0.88), "random": "0.15"}
    if outfit.top_pattern == "bands":
        return flat | {"mark": "edge", "markrgb": numbers(REFLECTIVE)}
    other = top * 0.45 if top.mean() > 0.45 else top * 0.4 + 0.55
    return {"builtin": "checker", "rgb1": numbers(top), "rgb2": numbers(other)}


def _texture_coordinates(rest: NDArray[np.float64], part: str, pattern: str) -> NDArray[np.float64]:
    """(N, 2) texture coordinates of a part: across and along the limb or the trunk."""
    is_arm = "sleeve" in part or "arm" in part
    along, across = (np.abs(rest[:, 0]), rest[:, 2]) if is_arm else (rest[:, 1], rest[:, 0])
    if pattern in PATTERN_PERIOD:
        return np.stack([np.full_like(along, 0.25), along / PATTERN_PERIOD[pattern]], axis=1)
    return np.stack([across, along], axis=1) / (CHECK_SIZE if pattern == "checks" else CLOTH_SIZE)


def _mesh(
    name: str, shape: Shape, normals: NDArray[np.float64], texture_places: NDArray[np.float64] | None = None
) -> Element:
    """An MJCF mesh of a shape, without the vertices that no face uses."""
    used, faces = np.unique(shape.faces, return_inverse=True)
    corners = {"vertex": numbers(shape.vertices[used]), "normal": numbers(normals[used], 3)}
    mesh = Element("mesh", {"name": name, "inertia": "shell"} | corners)
    if texture_places is not None:
        mesh.set("texcoord", numbers(texture_places[used], 3))
    mesh.set("face", " ".join(map(str, faces.ravel())))
    return mesh


def _facial_features(name: str, figure: Figure) -> list[Element]:
    """Eyes, brows and mouth, which make a face recognisable; the numbers are positions and radii at rest, m."""
    features = [("lips", "lips", (0.0, 0.662, 0.1165), (0.024, 0.0075, 0.006))]
    for side, sign in (("left", 1), ("right", -1)):
        features += [
            (f"{side}_eye", "eye", (sign * 0.034, 0.742, 0.1035), (0.0155, 0.0095, 0.007)),
            (f"{side}_iris", "iris", (sign * 0.034, 0.742, 0.1085), (0.0075, 0.0075, 0.004)),
            (f"{side}_brow", "hair", (sign * 0.036, 0.766, 0.107), (0.021, 0.0055, 0.006)),
        ]
    quat, scale = quaternion(figure.head_rotation), figure.scale * figure.head_scale
    geoms = []
    for what, material, place, radii in features:
        centre, size = figure.on_head(np.array([place]))[0], scale * np.array(radii)
        if centre[2] > size.max():  # otherwise the face is pressed to the floor
            geoms.append(
                geom(f"{name}_{what}", Label.VICTIM, type="ellipsoid", pos=centre, quat=quat, size=size,
                     material=f"{name}_{material}", contype=0, conaffinity=0)
            )  # fmt: skip
    return geoms
