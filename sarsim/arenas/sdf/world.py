"""The shapes of an SDF world, each with its pose in the world.

Poses are resolved as SDF 1.12 says: ``relative_to`` any frame, link, joint or nested model of the same scope,
``placement_frame``, ``attached_to``, ``<include>`` with its own pose and ``merge``. As in Gazebo 11, the first
``<state>`` of a world overrides the poses of its models and links. Everything stands still where it is placed.

A link is as its collision shapes are, in the colour of its visual ones; a link without collision shapes is as it is
seen. What has no shape (light, physics, joints) is not read; plugins, sensors, actors, height maps and populations
are left out, and counted. What is missing or broken, or was thrown out of the world, is left out too, and named:
Gazebo shows the rest.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from defusedxml import ElementTree

from pipeline.arrays import Pose
from pipeline.errors import InputError
from pipeline.transforms import FARTHEST, inverse
from sarsim.arenas.sdf.colours import Colour, colour_of
from sarsim.arenas.sdf.frames import MODEL, Frames
from sarsim.arenas.sdf.meshes import Meshes
from sarsim.arenas.sdf.resources import Resources, missing
from sarsim.arenas.sdf.values import name_of, pose_of, relative_to
from sarsim.vetting.model_files import MOST_GEOMS, RefusedError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

LEFT_OUT = ("plugin", "sensor", "actor", "population", "heightmap")
"""Elements that a world is loaded without."""
ROOTS = ("sdf", "gazebo")
"""Root elements of a file."""
WORLD = "world"
_SHIPPED = {
    "ground_plane": "<model name='ground_plane'><link name='link'><collision name='collision'><geometry><plane>"
    "<normal>0 0 1</normal><size>100 100</size></plane></geometry></collision></link></model>",
    "sun": "<model name='sun'/>",
}
"""Models that come with Gazebo and that nearly every world includes, for worlds whose folder lacks them."""


@dataclass(frozen=True, eq=False)
class SdfModel:
    """A model in the world.

    Attributes:
        name: that the world gives it: of its ``<include>``, or else of the model itself.
        scoped: names of the models around it and its own, joined by ``::``; no other model has it.
        uri: from where it is included; empty if it stands in the file itself.
        T_world: its pose.
        missing: it has a mesh, or should have come from elsewhere, and nothing of its shapes can be read.
    """

    name: str
    scoped: str
    uri: str
    T_world: Pose
    missing: bool


Choice = Callable[[SdfModel], bool]
"""Chooses models."""


def _none(model: SdfModel) -> bool:
    return False


@dataclass(frozen=True, eq=False)
class SdfShape:
    """A shape in the world.

    Attributes:
        model: the scoped name of the model that has it.
        geometry: its ``<geometry>``.
        T_world: its pose.
        colour: red, green, blue, from 0 to 1; None if the file gives none.
        base: folder of the file that holds it.
        where: what to call it in error messages.
    """

    model: str
    geometry: "Element"
    T_world: Pose
    colour: Colour | None
    base: Path
    where: str


_OUTSIDE = SdfModel("", "", "", np.eye(4), False)
"""The world itself, as what its models stand in."""


@dataclass(frozen=True, eq=False)
class _Model:
    """A model, or a world, with its frames, and its links and the models in it by the names of their frames.

    One that is included and cannot be read is empty, and ``lost`` says why.
    """

    name: str
    element: "Element"
    base: Path
    where: str
    frames: Frames
    uri: str = ""
    lost: str = ""
    links: dict[str, "Element"] = field(default_factory=dict)
    nested: dict[str, "_Model"] = field(default_factory=dict)


class SdfWorld:
    """A world read from its file.

    Attributes:
        left_out: how many elements of each kind of ``LEFT_OUT`` there are.
        is_model: whether the file holds models alone, which stand on nobody's ground.
        lost: what is wrong with each thing that is missing or broken, in words.
        resources: the world's files.
        meshes: those among them.
    """

    def __init__(self, path: Path):
        """``path``: of a file with a world, or with models alone.

        Raises:
            InputError: the file is missing or invalid, one that it includes may harm, or there are too many models.
        """
        self.left_out: Counter[str] = Counter()
        self.lost: list[str] = []
        self.resources = Resources(path)
        self.meshes = Meshes(self.resources)
        self._models = 0
        root = self._root(path)
        world = root.find(WORLD)
        self.is_model = world is None
        self._world = self._read("", root if world is None else world, path, WORLD, (path.resolve(),))

    def models(self) -> Iterator[SdfModel]:
        """All models, those in others too, in the order of the file."""
        for model, placed, _ in self._placed(self._world, _OUTSIDE, self._world.element.find("state")):
            if model is not self._world:
                yield placed

    def shapes(self, without: Choice = _none) -> Iterator[SdfShape]:
        """All shapes, in the order of the file, but those of the models that ``without`` chooses and all in them."""
        for model, placed, state in self._placed(self._world, _OUTSIDE, self._world.element.find("state"), without):
            with self.without():
                if model.lost:
                    raise InputError(model.lost)
                yield from self._own_shapes(model, placed, state)

    @contextmanager
    def without(self) -> Iterator[None]:
        """Go on without what is missing or broken in the block, and note it."""
        try:
            yield
        except RefusedError:
            raise
        except InputError as error:
            self.lost.append(str(error))

    def _root(self, path: Path) -> "Element":
        root = self.resources.parse(path)
        if root.tag not in ROOTS:
            raise InputError(f"{path}: not an SDF file: its root is <{root.tag[:40]}>, not <sdf>")
        if root.find(".//origin[@pose]") is not None:
            raise InputError(f"{path}: SDF of a version before 1.3, with <origin>, is not read")
        self.left_out.update(element.tag for element in root.iter() if element.tag in LEFT_OUT)
        return root

    def _read(self, name: str, element: "Element", path: Path, root: str, files: tuple[Path, ...]) -> _Model:
        """Read a model or a world; ``files`` are those that include one another down to this one."""
        where = f"{path}, <{element.tag}> {name_of(element)}".rstrip()
        model = _Model(name, element, path.parent, where, Frames(where, root))
        self._models += 1
        if self._models > MOST_GEOMS:
            raise RefusedError(f"{path}: too many models, at most {MOST_GEOMS} are built")
        for child in element:
            with self.without():
                self._add(model, child, path, root, files)
        return model

    def _add(self, model: _Model, child: "Element", path: Path, root: str, files: tuple[Path, ...]) -> None:
        """Add a child of the element of a model or a world, if it is of a kind that is read."""
        place, name = f"{model.where}, <{child.tag}> {name_of(child)}".rstrip(), child.get("name", "")
        if child.tag == "link":
            model.links[model.frames.add(name, pose_of(child, place), relative_to(child, root))] = child
        elif child.tag == "frame":
            owner = child.get("attached_to") or root
            model.frames.add(name, pose_of(child, place), relative_to(child, owner))
        elif child.tag == "joint":
            owner = (child.findtext("child") or root).strip()
            model.frames.add(name, pose_of(child, place), relative_to(child, owner))
        elif child.tag == "model":
            self._nest(model, child, child, self._read(name, child, path, MODEL, files))
        elif child.tag == "include":
            self._include(model, child, files)

    def _include(self, model: _Model, include: "Element", files: tuple[Path, ...]) -> None:
        uri, name = (include.findtext("uri") or "").strip(), (include.findtext("name") or "").strip()
        where = f"{model.where}, <include>"
        try:
            included, path = self._included(uri, model.base, where, files)
        except RefusedError:
            raise
        except InputError as error:
            placeholder = _Model(
                name or _last(uri), ElementTree.fromstring("<model/>"), model.base, where, Frames(where)
            )
            self._nest(model, include, include, replace(placeholder, uri=uri, lost=str(error)))
            return
        if included is not None:  # a file may hold a light alone
            placed = include if include.find("pose") is not None else included
            nested = self._read(name or included.get("name", ""), included, path, MODEL, (*files, path))
            self._nest(model, include, placed, replace(nested, uri=uri))

    def _included(self, uri: str, base: Path, where: str, files: tuple[Path, ...]) -> "tuple[Element | None, Path]":
        """The model that a URI names, and the file that holds it."""
        path = self.resources.find(uri, base, where) if uri else None
        if path is None:
            shipped = _SHIPPED.get(_last(uri).lower().replace(" ", "_"))
            if shipped is None:
                raise missing(uri, where)
            return ElementTree.fromstring(shipped), files[-1]
        path = self._model_file(path)
        if path in files:
            raise InputError(f"{where}: {path} includes itself")
        return self._root(path).find("model"), path

    def _model_file(self, path: Path) -> Path:
        """The SDF file of a model's folder, of the newest version that ``model.config`` lists."""
        if not path.is_dir():
            return path
        config, name = path / "model.config", "model.sdf"
        if config.exists():
            texts = [(e.get("version", ""), (e.text or "").strip()) for e in self.resources.parse(config).iter("sdf")]
            listed = [(_version(version), text) for version, text in texts if text]
            name = max(listed)[1] if listed else name
        file = self.resources.find(name, path, str(config))
        if file is None:
            raise InputError(f"{path / name}: the model's file is missing")
        return file

    @staticmethod
    def _nest(model: _Model, owner: "Element", placed: "Element", nested: _Model) -> None:
        """Add a nested model: ``owner`` says how, and ``placed`` has its pose."""
        frame = owner.get("placement_frame") or (owner.findtext("placement_frame") or "").strip()
        frame = frame or nested.element.get("placement_frame") or MODEL
        T, parent = pose_of(placed, nested.where), relative_to(placed, model.frames.root)
        merged = owner.get("merge") in ("true", "1")
        model.nested[model.frames.add(nested.name, T, parent, nested.frames, frame, merged)] = nested

    def _placed(
        self, model: _Model, outside: SdfModel, state: "Element | None", without: Choice = _none
    ) -> "Iterator[tuple[_Model, SdfModel, Element | None]]":
        """A model and all in it, each with its place and its state."""
        yield model, outside, state
        for name, nested in model.nested.items():
            with self.without():
                own = _named(state, "model", nested.name)
                where = f"{nested.where}, <state>"
                T = outside.T_world @ model.frames.pose(name) if own is None else pose_of(own, where)
                placed = SdfModel(nested.name, f"{outside.scoped}::{name}".removeprefix("::"), nested.uri, T, False)
                placed = replace(placed, missing=self._is_missing(nested))
                if not without(placed):
                    yield from self._placed(nested, placed, own, without)

    def _is_missing(self, model: _Model) -> bool:
        """Whether a model should have a shape and nothing of its shapes can be read."""
        geometries = [g for g in model.element.iterfind("link/*/geometry") if len(g)]
        if any(g.find("mesh") is None for g in geometries) or model.nested:
            return False
        uris = [(g.findtext("mesh/uri") or "").strip() for g in geometries]
        return bool(model.lost or uris) and not any(self._has_mesh(uri, model) for uri in uris)

    def _has_mesh(self, uri: str, model: _Model) -> bool:
        try:
            path = self.resources.find(uri, model.base, model.where)
            return path is not None and bool(self.meshes.surfaces(path))
        except InputError:
            return False

    def _own_shapes(self, model: _Model, placed: SdfModel, state: "Element | None") -> Iterator[SdfShape]:
        for name, link in model.links.items():
            with self.without():
                own = _named(state, "link", link.get("name", ""))
                yield from self._link_shapes(model, name, link, placed, own)

    def _link_shapes(
        self, model: _Model, name: str, link: "Element", placed: SdfModel, state: "Element | None"
    ) -> Iterator[SdfShape]:
        where, T_world = f"{model.where}, <link> {name_of(link)}", placed.T_world
        if state is not None:
            T_world = pose_of(state, f"{where}, <state>") @ inverse(model.frames.pose(name))
        visuals = [visual for visual in link.findall("visual") if visual.find("geometry") is not None]
        solid = [collision for collision in link.findall("collision") if collision.find("geometry") is not None]
        for shape in solid or visuals:
            place = f"{where}, <{shape.tag}> {name_of(shape)}"
            with self.without():
                T = T_world @ model.frames.pose(relative_to(shape, name)) @ pose_of(shape, place)
                geometry = shape.find("geometry")
                assert geometry is not None
                if not (np.abs(T[:3, 3]) <= FARTHEST).all():
                    raise InputError(f"{place}: lies farther away than {FARTHEST:g} m")
                yield SdfShape(placed.scoped, geometry, T, colour_of(shape, visuals), model.base, place)


def _named(state: "Element | None", tag: str, name: str) -> "Element | None":
    """The state of a model or a link that has a pose."""
    found = () if state is None else (e for e in state.findall(tag) if e.get("name") == name)
    return next((e for e in found if e.find("pose") is not None), None)


def _last(uri: str) -> str:
    """The last part of a URI, which is the name of the model that it means."""
    return " ".join(uri.rstrip("/").rpartition("/")[2].replace("%20", " ").split())


def _version(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(".") if part.isdecimal())
