"""The shapes of an SDF world, each with its pose in the world.

Poses are resolved as in SDF 1.12, including ``placement_frame``, ``attached_to``, the pose and ``merge`` of an
``<include>``, and ``relative_to`` with any frame, link, joint or nested model of the same scope. As in Gazebo 11, the
first ``<state>`` of a world overrides the poses of models and links. Sizes in the state are not read, because they
equal the sizes in the rest of the file. All models are static.

A link has the shapes of its collision elements, in the colours of its visuals. If no collision shape can be read, the
link has the shapes of its visuals. Physics settings are not read, and joints are read only as frames. Plugins,
sensors, actors, lights, roads and projectors are left out and counted. Missing and broken items are left out and
named in a warning; Gazebo also shows the rest of such a world.
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
from pipeline.errors import InputError, required
from pipeline.transforms import FARTHEST, from_rotation, inverse
from sarsim.arenas.sdf.colours import Colour
from sarsim.arenas.sdf.frames import MODEL, Frames
from sarsim.arenas.sdf.meshes import Meshes
from sarsim.arenas.sdf.model_folders import model_file
from sarsim.arenas.sdf.population import places_of
from sarsim.arenas.sdf.resources import MissingError, Resources
from sarsim.arenas.sdf.state import State, children_of, world_state
from sarsim.arenas.sdf.values import name_of, pose_of, reference_of
from sarsim.vetting.model_files import MAX_GEOMS, RefusedError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

LEFT_OUT = ("plugin", "sensor", "actor", "light", "road", "projector")
"""Elements that are left out of a world."""
ROOT_TAGS = ("sdf", "gazebo")
"""Root elements of SDF files."""
WORLD = "world"
_OLD_ELEMENTS = (
    ".//origin[@pose]",
    ".//box[@size]",
    ".//cylinder[@radius]",
    ".//sphere[@radius]",
    ".//mesh[@filename]",
)
"""Elements that occur only in versions of SDF before 1.3."""
_GAZEBO_MODELS = {
    "ground_plane": "<model name='ground_plane'><link name='link'><collision name='collision'><geometry><plane>"
    "<normal>0 0 1</normal><size>100 100</size></plane></geometry></collision></link></model>",
    "sun": "<model name='sun'/>",
}
"""Models of Gazebo that nearly all worlds include; these replacements are used if the models are not found."""


@dataclass(frozen=True, eq=False)
class SdfModel:
    """A model in the world.

    Attributes:
        name: name in the world: the name in the ``<include>``, or else the model's own name.
        scoped_name: unique name: the names of the models that contain the model and its own name, joined by ``::``.
        uri: URI from which the model is included; empty if the model is defined in the file itself.
        T_world: pose in the world.
        is_missing: whether the model could not be included, or has shapes of which none can be read.
        is_empty: whether neither the model nor any model nested in it has shapes, although all could be included.
    """

    name: str
    scoped_name: str
    uri: str
    T_world: Pose
    is_missing: bool
    is_empty: bool


ModelPredicate = Callable[[SdfModel], bool]
"""A function that selects models."""


def _never(model: SdfModel) -> bool:
    return False


@dataclass(frozen=True, eq=False)
class SdfShape:
    """A collision or visual shape in the world.

    Attributes:
        model: scoped name of its model.
        geometry: its ``<geometry>``.
        T_world: pose in the world.
        colour: red, green, blue, from 0 to 1; None if the file gives none.
        base: folder of the file that contains the shape.
        where: location of the shape for error messages.
    """

    model: str
    geometry: "Element"
    T_world: Pose
    colour: Colour | None
    base: Path
    where: str


_OUTSIDE = SdfModel("", "", "", np.eye(4), is_missing=False, is_empty=False)
"""The world itself, as the parent of its models."""


@dataclass(frozen=True, eq=False)
class _Model:
    """A model or a world, with its frames, and its links and nested models by the names of their frames.

    If an included model cannot be read, the model is empty and ``error`` is set.
    """

    name: str
    element: "Element"
    base: Path
    where: str
    frames: Frames
    uri: str = ""
    error: InputError | None = None
    links: dict[str, "Element"] = field(default_factory=dict)
    nested: dict[str, "_Model"] = field(default_factory=dict)


class SdfWorld:
    """A world read from its file.

    Attributes:
        left_out: number of elements of each kind in ``LEFT_OUT``.
        is_model: whether the file contains only models, and therefore not the ground of a world.
        errors: a message for each broken item.
        missing: the URIs that could not be found, in file order.
        resources: the world's files.
        meshes: the world's mesh files.
    """

    def __init__(self, path: Path):
        """``path``: path of a file with a world, or with only models.

        Raises:
            InputError: the file is missing or invalid, an included file may be harmful, or there are too many models.
        """
        self.left_out: Counter[str] = Counter()
        self.errors: list[str] = []
        self.missing: list[str] = []
        self.resources = Resources(path)
        self.meshes = Meshes(self.resources)
        self._models = 0
        root = self._root(path)
        worlds = root.findall(WORLD)
        self.is_model = not worlds
        beside = [*worlds[1:], *root.findall("model")] if worlds else []
        if beside:
            said = ", ".join(f"<{e.tag}> {name_of(e)}" for e in beside)
            self.errors.append(f"{path}, {said[:200]}: ignored; only the first <world> of a file is read")
        self._world = self._read("", worlds[0] if worlds else root, path, WORLD, (path.resolve(),))
        self._state = world_state(self._world.element)

    def models(self) -> Iterator[SdfModel]:
        """Yield all models in file order, including nested models."""
        for model, placed, _ in self._placed(self._world, _OUTSIDE, self._state, _never):
            if model is not self._world:
                yield placed

    def shapes(self, without: ModelPredicate = _never) -> Iterator[SdfShape]:
        """Yield all shapes in file order, but skip models that ``without`` selects and all models nested in them."""
        for model, placed, state in self._placed(self._world, _OUTSIDE, self._state, without):
            with self.skipping_errors():
                if model.error is not None:
                    raise model.error
                yield from self._own_shapes(model, placed, state)

    @contextmanager
    def skipping_errors(self) -> Iterator[None]:
        """Record an error that a missing or broken item raises in the context, and leave the context."""
        try:
            yield
        except RefusedError:
            raise
        except MissingError as error:
            self.missing.append(error.uri)
        except InputError as error:
            self.errors.append(str(error))

    def _root(self, path: Path) -> "Element":
        root = self.resources.parse(path)
        if root.tag not in ROOT_TAGS:
            tag = root.tag.rpartition("}")[2][:40]
            raise InputError(f"{path}: the root element of an SDF file must be <sdf>, not <{tag}>")
        if any(root.find(old) is not None for old in _OLD_ELEMENTS):
            raise InputError(
                f"{path}: SDF versions before 1.3, with poses and sizes as attributes, are not supported;"
                " convert the file to version 1.3 or later"
            )
        of_states = {element for state in root.iter("state") for element in state.iter()}
        self.left_out.update(e.tag for e in root.iter() if e.tag in LEFT_OUT and e not in of_states)
        return root

    def _read(self, name: str, element: "Element", path: Path, root: str, files: tuple[Path, ...]) -> _Model:
        """Read a model or a world; ``files``: chain of including files, down to the file with the element."""
        where = f"{path}, <{element.tag}> {name_of(element)}".rstrip()
        model = _Model(name, element, path.parent, where, Frames(where, root))
        self._models += 1
        if self._models > MAX_GEOMS:
            raise RefusedError(f"{path}: has more models than the limit of {MAX_GEOMS}")
        for child in children_of(element):
            with self.skipping_errors():
                self._add(model, child, path, root, files)
        return model

    def _add(self, model: _Model, child: "Element", path: Path, root: str, files: tuple[Path, ...]) -> None:
        """Add a child element of a model or a world, unless elements of this kind are ignored."""
        place, name = f"{model.where}, <{child.tag}> {name_of(child)}".rstrip(), child.get("name", "")
        if child.tag == "link":
            model.links[_add_frame(model, child, name, place, root)] = child
        elif child.tag == "frame":
            _add_frame(model, child, name, place, child.get("attached_to") or root)
        elif child.tag == "joint":
            _add_frame(model, child, name, place, (child.findtext("child") or root).strip())
        elif child.tag == "model":
            _add_nested(model, child, child, self._read(name, child, path, MODEL, files))
        elif child.tag == "include":
            self._include(model, child, files)
        elif child.tag == "population":
            self._populate(model, child, place, path, files)

    def _populate(
        self, model: _Model, population: "Element", where: str, path: Path, files: tuple[Path, ...]
    ) -> None:
        """Add the copies of a population's model, each with a number appended to its name."""
        places = places_of(population, where)
        for n, place in enumerate(places):
            for child in population:
                if child.tag in ("model", "include"):
                    copy = _Model("", population, model.base, where, Frames(where))
                    self._add(copy, child, path, MODEL, files)
                    for nested in copy.nested.values():
                        name = f"{nested.name}_clone_{n}"
                        added = model.frames.add(
                            name, from_rotation(np.eye(3), place), model.frames.root, nested.frames
                        )
                        model.nested[added] = replace(nested, name=name)

    def _include(self, model: _Model, include: "Element", files: tuple[Path, ...]) -> None:
        uri, name = (include.findtext("uri") or "").strip(), (include.findtext("name") or "").strip()
        where = f"{model.where}, <include>"
        try:
            included, path = self._included(uri, model.base, where, files)
        except RefusedError:
            raise
        except InputError as error:
            nothing = ElementTree.fromstring("<model/>")
            absent = _Model(name or _last_part(uri), nothing, model.base, where, Frames(where), uri=uri, error=error)
            _add_nested(model, include, include, absent)
            return
        if included is not None:  # a file may contain only a light
            placed = include if include.find("pose") is not None else included
            nested = self._read(name or included.get("name", ""), included, path, MODEL, (*files, path))
            _add_nested(model, include, placed, replace(nested, uri=uri))

    def _included(self, uri: str, base: Path, where: str, files: tuple[Path, ...]) -> "tuple[Element | None, Path]":
        """The model for a URI, or None for a light or an actor, and the path of the file that contains it."""
        path = self.resources.find(uri, base, where) if uri else None
        if path is None:
            shipped = _GAZEBO_MODELS.get(_last_part(uri).lower().replace(" ", "_"))
            if shipped is None:
                raise MissingError(uri, where)
            return ElementTree.fromstring(shipped), files[-1]
        path = model_file(self.resources, path)
        if path in files:
            raise InputError(f"{where}: {path} includes itself")
        root = self._root(path)
        models = root.findall("model")
        if not models and root.find("light") is None and root.find("actor") is None:
            raise InputError(f"{where}: {path} contains no <model>")
        if len(models) > 1:
            self.errors.append(
                f"{path}, <model> {name_of(models[1])}: ignored; only the first <model> of an included file is read"
            )
        return (models[0] if models else None), path

    def _placed(
        self, model: _Model, outside: SdfModel, state: State, without: ModelPredicate
    ) -> Iterator[tuple[_Model, SdfModel, State]]:
        """Yield a model and all models nested in it, each with its placement in the world and its state."""
        yield model, outside, state
        for name, nested in model.nested.items():
            with self.skipping_errors():
                own = state.of_model(nested.name)
                T = outside.T_world @ model.frames.pose(name)
                if own.pose is not None:
                    T = pose_of(own.pose, f"{nested.where}, <state>")
                scoped_name = f"{outside.scoped_name}::{name}".removeprefix("::")
                missing, is_empty = self._is_missing(nested), _is_empty(nested)
                placed = SdfModel(nested.name, scoped_name, nested.uri, T, missing, is_empty)
                if not without(placed):
                    yield from self._placed(nested, placed, own, without)

    def _is_missing(self, model: _Model) -> bool:
        """Whether a model without nested models could not be included, or has shapes of which none can be read."""
        shapes = _shapes_in(model)
        return (
            not model.nested and bool(shapes or model.error) and not any(self._is_readable(s, model) for s in shapes)
        )

    def _is_readable(self, shape: "Element", model: _Model) -> bool:
        """Whether a shape has a geometry that can be read, including its mesh file, if any."""
        mesh = shape.find("geometry/mesh")
        if mesh is None:
            return shape.find("geometry/*") is not None
        try:
            path = self.resources.find((mesh.findtext("uri") or "").strip(), model.base, model.where)
            return path is not None and bool(self.meshes.surfaces(path))
        except InputError:
            return False

    def _own_shapes(self, model: _Model, placed: SdfModel, state: State) -> Iterator[SdfShape]:
        for name, link in model.links.items():
            with self.skipping_errors():
                where, T = f"{model.where}, <link> {name_of(link)}", placed.T_world @ model.frames.pose(name)
                own = state.of_link(link.get("name", ""))
                if own is not None:
                    T = pose_of(own, f"{where}, <state>")
                T_world = T @ inverse(model.frames.pose(name))
                yield from self._link_shapes(model, name, link, replace(placed, T_world=T_world), where)

    def _link_shapes(
        self, model: _Model, name: str, link: "Element", placed: SdfModel, where: str
    ) -> Iterator[SdfShape]:
        solid, visuals = (
            [shape for shape in link.findall(tag) if shape.find("geometry") is not None and not _is_invisible(shape)]
            for tag in ("collision", "visual")
        )
        is_solid, is_seen = (any(self._is_readable(shape, model) for shape in shapes) for shapes in (solid, visuals))
        for shape in [*solid, *visuals] if is_seen and not is_solid else solid or visuals:
            place = f"{where}, <{shape.tag}> {name_of(shape)}"
            with self.skipping_errors():
                T = placed.T_world @ model.frames.pose(*reference_of(shape, name)) @ pose_of(shape, place)
                geometry = required(shape.find("geometry"))
                if not (np.abs(T[:3, 3]) <= FARTHEST).all():
                    x, y, z = T[:3, 3]
                    raise InputError(f"{place}: ({x:g}, {y:g}, {z:g}) m is more than {FARTHEST:g} m from the origin")
                colour = self.meshes.materials.of_shape(shape, visuals, model.base)
                yield SdfShape(placed.scoped_name, geometry, T, colour, model.base, place)


def _shapes_in(model: _Model) -> "list[Element]":
    """The shapes of a model's links."""
    return [*model.element.iterfind("link/collision"), *model.element.iterfind("link/visual")]


def _is_empty(model: _Model) -> bool:
    """Whether neither a model nor any model nested in it has shapes, although all could be included."""
    return not (_shapes_in(model) or model.error) and all(_is_empty(nested) for nested in model.nested.values())


def _add_frame(model: _Model, child: "Element", name: str, where: str, owner: str) -> str:
    """Add the frame of a link, joint or ``<frame>``, by default relative to ``owner``; return the frame's name."""
    parent = reference_of(child, owner)
    return model.frames.add(name, pose_of(child, where), parent.relative_to, fallback=parent.fallback)


def _is_invisible(shape: "Element") -> bool:
    """Whether a visual shape is fully transparent."""
    try:
        return float(shape.findtext("transparency") or 0.0) >= 1
    except ValueError:
        return False


def _add_nested(model: _Model, owner: "Element", placed: "Element", nested: _Model) -> None:
    """Add a nested model; ``owner`` gives its ``placement_frame`` and ``merge``, and ``placed`` gives its pose."""
    frame = owner.get("placement_frame") or (owner.findtext("placement_frame") or "").strip()
    frame = frame or nested.element.get("placement_frame") or MODEL
    T, parent = pose_of(placed, nested.where), reference_of(placed, model.frames.root)
    merged = owner.get("merge") in ("true", "1")
    frames = model.frames
    name = frames.add(nested.name, T, parent.relative_to, nested.frames, frame, merged, parent.fallback)
    model.nested[name] = nested


def _last_part(uri: str) -> str:
    """The last part of a URI, which is the name of the model."""
    return " ".join(uri.rstrip("/").rpartition("/")[2].replace("%20", " ").split())[:60]
