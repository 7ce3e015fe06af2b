"""A library of arena elements, and a builder that assembles elements into one MJCF document.

All static geoms belong to the world body, so that hundreds of elements do not slow down the physics. Each victim is a
separate body, ``victim_<id>``, and so is each other object to find. The document refers to no files except pictures
of signs and codes. MuJoCo's viewer can directly open a document without such pictures.
"""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import mujoco
import numpy as np
from defusedxml import ElementTree
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import Place, Places, Rotation3
from pipeline.errors import required
from pipeline.tracks.find import VICTIM
from sarsim.arenas.panels import covered_panels, numbers_of
from sarsim.arenas.things.models import ThingModel
from sarsim.arenas.things.thing import DEAD, annotate_body, data_of
from sarsim.assets import asset
from sarsim.ground_truth.shapes import rotation
from sarsim.victims.victims import VICTIM_PREFIX

TILE_SIZE = 1.2  # m
Attributes = Mapping[str, str | ArrayLike]
"""MJCF attributes by name, as text or as numbers."""
MIN_HEIGHT_RANGE = 1e-9  # A height field with a smaller range of heights is considered flat
REPLACED_ELEMENTS = ("hazmat_sign", "fire_extinguisher")
"""Elements that are replaced by an object to find; their geoms only extend the arena's bounds."""
_LIGHTS = (
    # name, direction, diffuse colour, whether the light casts shadows
    ("sun", (-0.35, 0.5, -0.8), (0.5, 0.5, 0.48), True),
    ("fill", (0.4, -0.3, -0.8), (0.25, 0.25, 0.26), False),
)


class ElementLibrary:
    """The elements of ``assets/arenas/elements.xml``.

    Attributes:
        types: names of all elements.
    """

    def __init__(self) -> None:
        path = asset("arenas", "elements.xml")
        self._root = ElementTree.parse(path, forbid_dtd=True).getroot()
        self._model = mujoco.MjModel.from_xml_path(str(path))
        self._bodies = {body.get("name"): body for body in self._root.iterfind("worldbody/body")}
        self.types = frozenset(self._bodies)

    def header(self) -> list[Element]:
        """Copies of the file's settings, assets and default classes, but not of worldbody and statistic."""
        return [deepcopy(child) for child in self._root if child.tag not in ("worldbody", "statistic")]

    def geoms(self, kind: str) -> list[Element]:
        """The ``<geom>`` elements of the library element ``kind``."""
        return self._bodies[kind].findall("geom")

    def mount_points(self, kind: str) -> NDArray[np.float64]:
        """(N, 2) m, x and z of an element's mount points in the element's frame."""
        sites = [numbers_of(site, "pos", (0, 0, 0)) for site in self._bodies[kind].iterfind("site")]
        return np.array(sites).reshape(-1, 3)[:, [0, 2]]

    def footprint(self, kind: str) -> NDArray[np.float64]:
        """(4, 2) m, corners of an element's bounding rectangle seen from above, in the element's frame."""
        model = self._model
        geoms = np.flatnonzero(model.geom_bodyid == model.body(kind).id)
        R = np.array([rotation(model.geom_quat[geom]) for geom in geoms])
        middle = model.geom_pos[geoms] + np.einsum("nij,nj->ni", R, model.geom_aabb[geoms, :3])
        reach = np.einsum("nij,nj->ni", np.abs(R), model.geom_aabb[geoms, 3:])
        (x0, y0, _), (x1, y1, _) = (middle - reach).min(axis=0), (middle + reach).max(axis=0)
        return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


@cache
def element_library() -> ElementLibrary:
    """The library of arena elements; its file is read once."""
    return ElementLibrary()


class ArenaBuilder:
    """Builds an arena's MJCF document.

    Attributes:
        root: the ``<mujoco>`` element built so far; callers may add their own geoms.
        files: contents of the pictures to which the document refers, by name.
    """

    def __init__(self, name: str):
        self.root = Element("mujoco", model=name)
        self.root.extend(element_library().header())
        self._world = SubElement(self.root, "worldbody")
        self._geom_keys: set[tuple[object, ...]] = set()
        self._corners: list[NDArray[np.float64]] = []
        self._assets: dict[tuple[object, ...], str] = {}
        self.files: dict[str, bytes] = {}

    def add_element(self, kind: str, position: ArrayLike, yaw_deg: float) -> None:
        """Add a library element with its origin at ``position`` (3,) m, turned left by ``yaw_deg`` degrees.

        Elements in ``REPLACED_ELEMENTS`` only extend the arena's bounds.

        A geom that coincides with an earlier one is left out, because two neighbouring tiles may both include the
        wall between them.
        """
        pose = _Pose(np.asarray(position, np.float64), _yaw_quaternion(yaw_deg))
        geoms = element_library().geoms(kind)
        self._corners.append(pose.points(element_library().footprint(kind)))
        victim = [geom for geom in geoms if geom.get("class") == "victim"]
        for geom in geoms:
            if geom not in victim and kind not in REPLACED_ELEMENTS:
                self._add_unless_coincident(kind, pose.geom(geom))
        if victim:
            self._add_victim(victim, pose)

    def add_thing(self, thing: ThingModel, position: ArrayLike, R: Rotation3) -> None:
        """Add an object to find with its origin at ``position`` (3,) m and orientation ``R`` (3, 3)."""
        thing.add_to(self.root, position, R)
        self.files |= thing.files

    @property
    def next_thing_number(self) -> int:
        """Number of the next object to find; all objects, including victims, are numbered from 1."""
        return 1 + len(self.root.findall("custom/text"))

    @property
    def next_victim_name(self) -> str:
        """The name of the next victim's body."""
        names = [body.get("name", "") for body in self._world.iterfind("body")]
        return f"{VICTIM_PREFIX}{1 + sum(name.startswith(VICTIM_PREFIX) for name in names)}"

    def add_victim(
        self, position: ArrayLike, geoms: Sequence[tuple[Attributes, Sequence[float] | None]], state: str
    ) -> None:
        """Add a victim made of geoms from outside the library.

        Args:
            position: (3,) m, position of the victim's body.
            geoms: the MJCF attributes of each geom and its colour: red, green, blue, from 0 to 1, or None for the
                default colour of victims.
            state: alive or dead; empty if unknown.
        """
        name = self.next_victim_name
        body = SubElement(self._world, "body", name=name, pos=_text(position))
        for n, (geom, colour) in enumerate(geoms):
            paint = {} if colour is None else {"material": self._material_name(colour)}
            named = {"name": f"{name}_part_{n}", "class": "victim"}
            body.append(Element("geom", named | _text_attributes(geom) | paint))
        annotate_body(self.root, name, VICTIM, state=state)

    def set_missing_states(self, state: str) -> int:
        """Set the state of all victims without a state, and return the number of these victims."""
        unsettled = [text for text in self.root.findall("custom/text") if text.get("data") == data_of(VICTIM)]
        for text in unsettled:
            text.set("data", data_of(VICTIM, state=state))
        return len(unsettled)

    def add_box(
        self, name: str, label: str, position: ArrayLike, yaw_deg: float, middle: ArrayLike, half: ArrayLike,
        colour: tuple[float, float, float],
    ) -> None:  # fmt: skip
        """Add a box that is part of an element outside the library.

        Args:
            name: prefix of the geom's name.
            label: default class of the geom.
            position: (3,) m, origin of the element.
            yaw_deg: angle by which the element is turned to the left, degrees.
            middle: (3,) m, centre of the box in the element's frame.
            half: (3,) m, half sizes of the box.
            colour: red, green, blue, from 0 to 1.
        """
        box = {"class": label, "pos": _text(middle), "size": _text(half), "rgba": _text((*colour, 1.0))}
        pose = _Pose(np.asarray(position, np.float64), _yaw_quaternion(yaw_deg))
        self._add_unless_coincident(name, pose.geom(Element("geom", box)))

    def _add_unless_coincident(self, kind: str, geom: Element) -> None:
        if (key := _geom_key(geom)) not in self._geom_keys:
            self._geom_keys.add(key)
            # PyMJCF's run time grows with the square of the number of unnamed geoms.
            geom.set("name", f"{kind}_{len(self._geom_keys)}")
            self._world.append(geom)

    def _add_victim(self, geoms: list[Element], pose: "_Pose") -> None:
        name = self.next_victim_name
        body = SubElement(self._world, "body", name=name, pos=_text(pose.position), quat=_text(pose.quat))
        body.extend(Element("geom", geom.attrib | {"name": f"{name}_part_{n}"}) for n, geom in enumerate(geoms))
        annotate_body(self.root, name, VICTIM, state=DEAD)  # the library's victim is a picture, as cold as the wall

    def add_geom(self, label: str, geom: Attributes, colour: Sequence[float] | None = None) -> None:
        """Add a geom that belongs to no element.

        Args:
            label: default class of the geom.
            geom: MJCF attributes of the geom.
            colour: red, green, blue, from 0 to 1; by default, the colour of the label's material.
        """
        # PyMJCF's run time grows with the square of the number of unnamed geoms.
        named = {"name": f"{label}_{len(self._world)}", "class": label}
        paint = {} if colour is None else {"material": self._material_name(colour)}
        self._world.append(Element("geom", named | _text_attributes(geom) | paint))

    def add_mesh(self, vertices: NDArray[np.float64], triangles: NDArray[np.int64] | None = None) -> str:
        """Add a mesh and return its name.

        Args:
            vertices: (N, 3) m.
            triangles: (M, 3) indices of vertices; by default, the mesh is the convex hull of the vertices.
        """
        faces = {} if triangles is None else {"face": " ".join(map(str, np.ravel(triangles).tolist()))}
        return self._asset_name("mesh", {"vertex": vertices, "inertia": "shell", **faces})

    def add_height_field(self, heights: NDArray[np.float64], size: ArrayLike) -> str:
        """Add a height field and return its name.

        Args:
            heights: (rows, columns) heights, in any unit; y increases with the row.
            size: (4,) m, half sizes along x and y, height from the lowest to the highest point, and thickness below
                the lowest point.
        """
        rows, columns = heights.shape
        shown = (heights - heights.min()) / max(float(np.ptp(heights)), MIN_HEIGHT_RANGE)
        counts = {"nrow": str(rows), "ncol": str(columns)}
        return self._asset_name("hfield", {**counts, "elevation": shown[::-1], "size": size})  # largest y first

    def _material_name(self, colour: Sequence[float]) -> str:
        return self._asset_name("material", {"rgba": (*colour, 1.0), "specular": (0.05,), "shininess": (0.1,)})

    def _asset_name(self, kind: str, attributes: Attributes) -> str:
        """The name of the asset with these attributes, which is added if it does not exist."""
        written = _text_attributes(attributes)
        key = (kind, *written.items())
        if key not in self._assets:
            self._assets[key] = f"{kind}_{len(self._assets)}"
            SubElement(required(self.root.find("asset")), kind, {"name": self._assets[key]} | written)
        return self._assets[key]

    def change_asset(self, kind: str, name: str, attributes: Mapping[str, str | Sequence[float]]) -> None:
        """Change attributes of a library ``texture`` or ``material`` in this arena."""
        (element,) = self.root.findall(f"asset/{kind}[@name='{name}']")
        for key, value in attributes.items():
            element.set(key, value if isinstance(value, str) else _text(value))

    def drop_covered_panels(self) -> None:
        """Remove the wall panels that lie inside other panels, because their faces coincide."""
        for geom in covered_panels(self._world.findall("geom")):
            self._world.remove(geom)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 2) m, lowest and highest x, y of all elements."""
        corners = np.concatenate(self._corners)
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    def add_floor(self, low: ArrayLike, high: ArrayLike) -> None:
        """Add the floor at z = 0 between two corners (x, y), m."""
        self._add_slab("floor", "terrain", low, high, 0.0, 0.1)

    def add_ceiling(self, low: ArrayLike, high: ArrayLike, height: float) -> None:
        """Add a ceiling between two corners (x, y), m, with its underside at ``height``, m."""
        self._add_slab("ceiling", "ceiling", low, high, height + 0.01, 0.01)

    def _add_slab(self, name: str, label: str, low: ArrayLike, high: ArrayLike, z: float, half_z: float) -> None:
        middle, half = np.add(low, high) / 2, np.subtract(high, low) / 2
        pose = {"pos": _text([*middle, z]), "size": _text([*half, half_z])}
        SubElement(self._world, "geom", {"name": name, "class": label} | pose)

    def add_surroundings(self, low: ArrayLike, high: ArrayLike, ceiling: bool = False) -> None:
        """Add lights, cameras and the model's extent for an arena between two corners (x, y), m.

        Under a ceiling, no light casts shadows, because the lights represent many lamps below the ceiling.
        """
        (x, y), extent = np.add(low, high) / 2, float(np.linalg.norm(np.subtract(high, low))) / 2
        SubElement(self.root, "statistic", center=_text((x, y, 0.3)), extent=_text([extent]))
        for name, direction, diffuse, shadow in _LIGHTS:
            attributes = {
                "name": name,
                "directional": "true",
                # A directional light farther away would produce striped shadows.
                "pos": _text(np.array([x, y, 0.3]) - extent * np.array(direction)),
                "dir": _text(direction),
                "diffuse": _text(diffuse),
                "specular": "0.1 0.1 0.1",
                "castshadow": str(shadow and not ceiling).lower(),
            }
            SubElement(self._world, "light", attributes)
        away = 1.25 * extent + 1
        above = {"name": "top", "pos": _text((x, y, 2.2 * extent + 2)), "fovy": "45"}
        aside = {"name": "overview", "pos": _text((x, y - away, 1.4 * away)), "fovy": "37"}
        SubElement(self._world, "camera", above)
        SubElement(self._world, "camera", aside | {"xyaxes": "1 0 0 0 0.814 0.581"})

    @property
    def has_start(self) -> bool:
        """Whether the robot's start is marked."""
        return self._world.find("site[@name='start']") is not None

    def set_start(self, position: ArrayLike, yaw: float) -> None:
        """Mark the robot's start at ``position`` (3,) m with heading ``yaw`` rad, replacing any earlier start."""
        for site in self._world.findall("site[@name='start']"):
            self._world.remove(site)
        pose = {"pos": _text(position), "quat": _text((np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)))}
        SubElement(self._world, "site", {"name": "start", "size": "0.02", "rgba": "0 0.6 0 0.5"} | pose)

    def to_xml(self) -> str:
        """The document as text, without unused meshes, materials and textures."""
        for kind, user in (("mesh", "geom"), ("material", "geom"), ("texture", "material")):
            used = {element.get(kind) for element in self.root.iter(user)}
            for assets in self.root.findall("asset"):
                for unused in [a for a in assets.findall(kind) if a.get("name") not in used]:
                    assets.remove(unused)
        indent(self.root)
        return tostring(self.root, encoding="unicode") + "\n"


@dataclass(frozen=True, eq=False)
class _Pose:
    """The pose of an element in the world.

    Attributes:
        position: (3,) m, origin of the element.
        quat: (4,) unit quaternion (w, x, y, z) of the rotation about z.
    """

    position: Place
    quat: NDArray[np.float64]

    def points(self, xy: NDArray[np.float64]) -> Places:
        """(N, 2) m, world coordinates of points (N, 2) m in the element's frame."""
        w, _, _, z = self.quat
        cos, sin = w * w - z * z, 2 * w * z
        return xy @ np.array([(cos, sin), (-sin, cos)]) + self.position[:2]

    def geom(self, geom: Element) -> Element:
        """A copy of a geom of the element, with the geom's pose in the world."""
        x, y, z = numbers_of(geom, "pos", (0, 0, 0))
        position = [*self.points(np.array([[x, y]]))[0], self.position[2] + z]
        quat = np.empty(4)
        mujoco.mju_mulQuat(quat, self.quat, numbers_of(geom, "quat", (1, 0, 0, 0)))
        return Element("geom", geom.attrib | {"pos": _text(position), "quat": _text(quat)})


def _yaw_quaternion(yaw_deg: float) -> NDArray[np.float64]:
    """Unit quaternion (w, x, y, z) of a rotation about z by ``yaw_deg`` degrees.

    Multiples of 90° are exact, so that tiles meet without gaps.
    """
    quarter, rest = divmod(yaw_deg, 90.0)
    if rest == 0:
        half = np.sqrt(0.5)
        w, z = ((1, 0), (half, half), (0, 1), (half, -half))[int(quarter) % 4]
        return np.array([w, 0, 0, z], np.float64)
    yaw = np.radians(yaw_deg)
    return np.array([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)])


def _geom_key(geom: Element) -> tuple[object, ...]:
    """A key that is equal for geoms that fill the same space and look alike."""
    w, x, y, z = numbers_of(geom, "quat", (1, 0, 0, 0))
    # A rotation by 180° about z maps an upright box, but not a mesh, onto itself.
    is_box = geom.get("mesh") is None and x == y == 0
    yaw = round(np.degrees(2 * np.arctan2(z, w)), 2) % (180 if is_box else 360)
    position = np.round(numbers_of(geom, "pos", (0, 0, 0)), 4) + 0.0
    shape = [geom.get(key) for key in ("class", "type", "mesh", "material", "size")]
    return (*shape, *position.tolist(), round(x, 4), round(y, 4), yaw)


def _text_attributes(attributes: Attributes) -> dict[str, str]:
    """The attributes, with numbers converted to MJCF text."""
    return {name: value if isinstance(value, str) else _text(value) for name, value in attributes.items()}


def _text(values: ArrayLike) -> str:
    """Numbers as MJCF text, rounded to six decimals to hide rounding errors that differ between machines."""
    return " ".join(f"{round(float(v), 6) + 0.0:.6f}".rstrip("0").rstrip(".") for v in np.ravel(values))
