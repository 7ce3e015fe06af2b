"""The colour of a shape, from its texture, a material that comes with Gazebo, a script or the values in the file."""

import re
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from pipeline.errors import InputError
from sarsim.arenas.sdf.resources import Resources
from sarsim.vetting.model_files import RefusedError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

Colour = tuple[float, float, float]
_NAMED: dict[str, Colour] = {
    "Grey": (0.7, 0.7, 0.7), "DarkGrey": (0.175, 0.175, 0.175), "White": (1, 1, 1), "Black": (0, 0, 0),
    "FlatBlack": (0.1, 0.1, 0.1), "Red": (1, 0, 0), "RedBright": (0.87, 0.26, 0.07), "Green": (0, 1, 0),
    "Blue": (0, 0, 1), "SkyBlue": (0.13, 0.44, 0.7), "Yellow": (1, 1, 0), "ZincYellow": (0.9725, 0.9529, 0.2078),
    "Orange": (1, 0.51, 0.05), "DarkYellow": (0.7, 0.7, 0), "Purple": (1, 0, 1), "Turquoise": (0, 1, 1),
    "Gold": (0.8, 0.65, 0.12), "Indigo": (0.33, 0, 0.5), "PioneerBody": (1, 0, 0), "Pioneer2Body": (0.68, 0, 0),
    # Approximate mean colours of textures that come with Gazebo.
    "Wood": (0.6, 0.42, 0.25), "WoodFloor": (0.55, 0.38, 0.22), "WoodPallet": (0.65, 0.5, 0.33),
    "Bricks": (0.55, 0.33, 0.27), "PaintedWall": (0.8, 0.78, 0.72), "CeilingTiled": (0.85, 0.85, 0.83),
    "WindowFrame": (0.6, 0.6, 0.6), "Grass": (0.3, 0.42, 0.18), "Steps": (0.5, 0.5, 0.5),
    **dict.fromkeys(("Pedestrian", "Footway"), (0.6, 0.58, 0.55)),
    **dict.fromkeys(
        ("Road", "Residential", "Tertiary", "Secondary", "Primary", "Trunk", "Motorway",
         "Lane_1", "Lanes_2", "Lanes_4", "Lanes_6"), (0.3, 0.3, 0.3)
    ),
}  # fmt: skip
"""Diffuse colours of the materials ``Gazebo/NAME`` in Gazebo's media/materials/scripts/gazebo.material."""
_VARIANT_SUFFIXES = ("Transparent", "TransparentOverlay", "Glow", "GlowOutline", "Laser")
"""Suffixes of material names that leave the colour unchanged."""
MAX_PIXELS = 2**26  # Maximum number of pixels of a texture: 8,192 × 8,192
SAMPLE_SIZE = 64  # pixels along a texture's shorter side that suffice for the mean colour
MAX_SCRIPTS = 100  # Maximum number of material files that are read in a folder
_BLOCK = re.compile(r"^\s*material\s+\"?([^\s\":{]+)\"?[^{]*(.*?)(?=^\s*material\s|\Z)", re.MULTILINE | re.DOTALL)
_SETTING = re.compile(r"^\s*(diffuse|ambient|texture)\s+(\S.*?)\s*$", re.MULTILINE)


class Materials:
    """Finds the colours of a world's materials; each texture is read once."""

    def __init__(self, resources: Resources):
        """``resources``: finds the world's files."""
        self._resources = resources
        self._means: dict[Path, Colour | None] = {}
        self._scripts: dict[Path, dict[str, str]] = {}

    def of_shape(self, shape: "Element", visuals: "Sequence[Element]", base: Path) -> Colour | None:
        """The colour of a shape in a file in folder ``base``.

        This is the shape's own colour, or else the colour of a visual with the same pose and geometry, or else the
        colour of the link's first visual.
        """
        alike = [visual for visual in visuals if _pose_and_geometry(visual) == _pose_and_geometry(shape)]
        owners = (shape, *alike, *visuals[:1])
        return next((colour for owner in owners if (colour := self._material(owner, base))), None)

    def mean(self, uri: str, base: Path) -> Colour | None:
        """The mean colour of the picture at a URI in a file in folder ``base``; None if it is missing or unreadable.

        Raises:
            RefusedError: the picture is outside the folders of the world and its models.
        """
        try:
            path = self._resources.find(uri.strip(), base, str(base)) if uri.strip() else None
            if path is None or not path.is_file():
                return None
            if path not in self._means:
                self._means[path] = _mean(self._resources.read(path))
            return self._means[path]
        except RefusedError:
            raise
        except InputError:
            return None

    def _material(self, shape: "Element", base: Path) -> Colour | None:
        material = shape.find("material")
        if material is None:
            return None
        written = next((c for tag in ("diffuse", "ambient") if (c := _parse_colour(material.findtext(tag)))), None)
        texture = self.mean(material.findtext(".//albedo_map") or "", base)
        if texture is not None:
            return product(texture, written or (1.0, 1.0, 1.0))
        name = (material.findtext("script/name") or "").strip()
        return _gazebo_colour(name) or self._of_scripts(name, material, base) or written

    def _of_scripts(self, name: str, material: "Element", base: Path) -> Colour | None:
        """The colour of a material in the model's own scripts."""
        folders = []
        for uri in material.iterfind("script/uri"):
            try:
                found = self._resources.find((uri.text or "").strip(), base, str(base))
            except RefusedError:
                raise
            except InputError:
                found = None
            if found is not None:
                folders.append(found if found.is_dir() else found.parent)
        for folder in folders:
            settings = _SETTING.findall(self._scripts_in(folder).get(name, ""))
            for place in (*folders, folder, folder.parent / "textures"):
                for texture in [value for key, value in settings if key == "texture"]:
                    if (colour := self.mean(texture.split()[0].strip('"'), place)) is not None:
                        return colour
            plain = [colour for key, value in sorted(settings, reverse=True) if (colour := _parse_colour(value))]
            if plain:  # the diffuse colour, else the ambient one
                return plain[0]
        return None

    def _scripts_in(self, folder: Path) -> dict[str, str]:
        """The texts of the materials in a folder's scripts, by name."""
        if folder not in self._scripts:
            texts: dict[str, str] = {}
            for path in sorted(folder.glob("*.material"))[:MAX_SCRIPTS]:
                try:
                    content = self._resources.read(path).decode("utf-8", "replace")
                except InputError:
                    continue
                texts.update(dict(_BLOCK.findall(content)))
            self._scripts[folder] = texts
        return self._scripts[folder]


def _gazebo_colour(name: str) -> Colour | None:
    """The colour of a Gazebo material or of a variant of one; None for other names."""
    plain = name.removeprefix("Gazebo/")
    stems = [plain, *(plain.removesuffix(ending) for ending in _VARIANT_SUFFIXES)]
    return next((_NAMED[stem] for stem in stems if stem in _NAMED), None)


def _mean(content: bytes) -> Colour | None:
    """The mean colour of the picture in a file's content; None if it is unreadable."""
    try:
        with Image.open(BytesIO(content)) as image:
            return mean_colour(image)
    except Exception:  # broken pictures raise many kinds of exceptions
        return None


def mean_colour(image: Image.Image) -> Colour | None:
    """The mean colour of a picture, weighted by opacity; None if the picture is fully transparent or too large."""
    if image.width * image.height > MAX_PIXELS:
        return None
    image.draft("RGB", (SAMPLE_SIZE, SAMPLE_SIZE))  # decodes a JPEG at a coarse scale
    pixels = np.asarray(image.convert("RGBA").reduce(max(1, min(image.size) // SAMPLE_SIZE)), np.float64) / 255
    weight = pixels[..., 3:]
    if not weight.any():
        return None
    red, green, blue = ((pixels[..., :3] * weight).sum(axis=(0, 1)) / weight.sum()).tolist()
    return red, green, blue


def product(a: Colour, b: Colour) -> Colour:
    """The product of two colours, such as a surface's own colour and the mean colour of its texture."""
    red, green, blue = np.multiply(a, b).tolist()
    return red, green, blue


def _pose_and_geometry(shape: "Element") -> list[str]:
    """The texts of a shape's pose and geometry, for comparing shapes."""
    parts = [part for tag in ("pose", "geometry") for part in shape.iterfind(tag)]
    return [f"{e.tag} {' '.join((e.text or '').split())}" for part in parts for e in part.iter()]


def _parse_colour(text: str | None) -> Colour | None:
    """The colour in a text; None if the text is not a valid colour, which is not an error."""
    try:
        red, green, blue = np.clip([float(word) for word in (text or "").split()[:3]], 0.0, 1.0).tolist()
    except ValueError:
        return None
    return (red, green, blue) if np.isfinite((red, green, blue)).all() else None
