"""MJCF as MuJoCo's own compiler understands it, so that it means the same alone and joined with another file.

A file of MJCF holds settings for its reader: the unit of angles, how inertias come about, folders, defaults, included
and attached files, frames, copies. Two files that are joined would read each other's. So MuJoCo reads each alone and
writes it again with numbers that need no setting: radians and quaternions, every inertia, every attribute where it
holds.
"""

import ctypes
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from defusedxml import ElementTree
from dm_control import mjcf
from numpy.typing import NDArray

from pipeline.arrays import Pose
from pipeline.errors import InputError
from pipeline.transforms import from_rotation
from sarsim.vetting.model_files import root_of

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

EXACT = 17  # digits with which a float64 is the same again
PATHS = {"mesh": "mesh_pathadr", "hfield": "hfield_pathadr", "texture": "tex_pathadr", "skin": "skin_pathadr"}
"""Elements with a file, and where a compiled model says which one MuJoCo opened."""
_Classes = dict[str, dict[str, dict[str, str]]]
Check = Callable[[mujoco.MjModel], None]
_TOP = "main"
"""MuJoCo's name of the default class that holds everywhere."""
DEFAULTS_OF = {"equality": "equality", "tendon": "tendon", "actuator": "general"}
"""The element of a default class for all elements of a section; elsewhere it is the one of the same tag."""
SIZES = (
    "nuserdata",
    *(f"nuser_{kind}" for kind in ("body", "jnt", "geom", "site", "cam", "tendon", "actuator", "sensor")),
)
"""Attributes of ``<size>`` for more than the file alone."""


def _no_check(model: mujoco.MjModel) -> None: ...


def resolved(path: Path, check: Check = _no_check) -> tuple[mujoco.MjModel, mjcf.RootElement]:
    """A model as MuJoCo compiles it, and as MJCF that means the same wherever it is joined in.

    Args:
        path: of the file.
        check: raises InputError for a compiled model that is not to be written again.

    Raises:
        InputError: the file is missing, or MuJoCo or PyMJCF cannot read it; or by ``check``.
    """
    with _one_line("not a readable MJCF file"):
        return _resolved(mujoco.MjSpec.from_file(str(path)), lambda name: Path(name).read_bytes(), path.parent, check)


def resolved_root(root: mjcf.RootElement, name: str) -> tuple[mujoco.MjModel, mjcf.RootElement]:
    """What :func:`resolved` returns, of MJCF that other code has made; an InputError begins with ``name``."""
    files = root.get_assets()
    with _one_line(f"{name}: MuJoCo cannot build it"):
        spec = mujoco.MjSpec.from_string(root.to_xml_string(precision=EXACT), assets=files)
        return _resolved(spec, files.__getitem__, Path())


@contextmanager
def _one_line(beginning: str) -> Iterator[None]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of settings that MuJoCo is going to drop
            yield
    except InputError:
        raise
    except (OSError, ValueError, KeyError, AttributeError, mujoco.FatalError) as error:
        raise InputError(f"{beginning}: {' '.join(str(error).split())}") from error


def _resolved(
    spec: mujoco.MjSpec, read: Callable[[str], bytes], folder: Path, check: Check = _no_check
) -> tuple[mujoco.MjModel, mjcf.RootElement]:
    spec.compiler.saveinertial = True
    spec.compiler.fusestatic = False  # it takes the names of bodies away, and moves nothing
    spec.compiler.alignfree = False
    for joint in spec.joints:
        joint.align = mujoco.mjtAlignFree.mjALIGNFREE_AUTO  # it moves a body's frame, and nothing in it
    model = spec.compile()
    check(model)
    root = _written(spec)
    _set_options(root, spec)
    files = _with_files(root, model, spec, read, folder)
    _apply_defaults(root)
    for body in [body for tag in ("worldbody", "body") for body in root.iter(tag)]:
        _open_frames(body)
    for text in root.iterfind("custom/text"):
        if text.text and "data" not in text.attrib:  # so MuJoCo writes what has special characters
            text.set("data", text.text)
    _rename(root)
    _drop_settings(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return model, mjcf.from_xml_string(text, assets=files)


def _written(spec: mujoco.MjSpec) -> "Element":
    """A compiled spec as XML, with all digits; six, as MuJoCo writes by itself, are half a millimetre at 100 m."""
    (path,) = Path(mujoco.__file__).parent.glob("libmujoco.*")
    library = ctypes.CDLL(str(path))
    before = library._mjPRIVATE__get_xml_precision()
    library._mjPRIVATE__set_xml_precision(EXACT)
    try:
        with TemporaryDirectory() as folder:
            spec.to_file(f"{folder}/model.xml")  # not to a text, which must be UTF-8, as names need not be
            return root_of(Path(folder, "model.xml").read_bytes())
    finally:
        library._mjPRIVATE__set_xml_precision(before)


def _set_options(root: "Element", spec: mujoco.MjSpec) -> None:
    """Write the options that the file sets, also those of which it says what MuJoCo takes by itself."""
    compiler = spec.compiler
    compiler.savecompiled = compiler.savecanonical = False
    authored = _written(spec).find("option")
    for option in root.findall("option"):
        root.remove(option)
    if authored is not None:
        root.append(authored)


def _with_files(
    root: "Element", model: mujoco.MjModel, spec: mujoco.MjSpec, read: Callable[[str], bytes], folder: Path
) -> dict[str, bytes]:
    """The contents of the files that MuJoCo opened, by their names, which the elements get."""
    files: dict[str, bytes] = {}

    def named(path: str) -> str:
        content, name = read(path), Path(path).name
        if files.setdefault(name, content) != content:
            name = f"{len(files)}_{name}"
            files[name] = content
        return name

    for tag, array in PATHS.items():
        for element, address in zip(root.iter(tag), getattr(model, array).tolist(), strict=False):
            if address >= 0:
                element.set("file", named(model.paths[address:].split(b"\0", 1)[0].decode()))
    for texture, element in zip(spec.textures, root.iterfind("asset/texture"), strict=True):
        for side in [key for key in element.attrib if key.startswith("file") and key != "file"]:
            element.set(side, named(str(folder / texture.compiler.texturedir / element.get(side, ""))))
    return files


def _apply_defaults(root: "Element") -> None:
    """Write into every element what its default class says, and take the classes away."""
    classes: _Classes = {_TOP: {}}
    for top in root.findall("default"):
        _collect(top, {}, classes)
        root.remove(top)
    for section in root:
        _fill(section, section.tag, _TOP, classes)


def _collect(default: "Element", inherited: Mapping[str, dict[str, str]], classes: _Classes) -> None:
    """Add a class and those in it: for each kind of element the attributes that it sets."""
    own = {tag: dict(attributes) for tag, attributes in inherited.items()}
    for child in default:
        if child.tag != "default":
            own.setdefault(child.tag, {}).update(child.attrib)
    classes[default.get("class", _TOP)] = own
    for child in default.iterfind("default"):
        _collect(child, own, classes)


def _fill(parent: "Element", section: str, childclass: str, classes: _Classes) -> None:
    childclass = parent.attrib.pop("childclass", childclass)
    for child in parent:
        own = classes[child.attrib.pop("class", childclass)].get(DEFAULTS_OF.get(section, child.tag), {})
        child.attrib.update({name: text for name, text in own.items() if name not in child.attrib})
        _fill(child, section, childclass, classes)


def _open_frames(body: "Element") -> None:
    """Move what is in a body's frames into the body itself, in the same order."""
    for frame in body.findall("frame"):
        _open_frames(frame)
        for child in frame:
            _move(child, _pose(frame))
        place = list(body).index(frame)
        body[place : place + 1] = list(frame)


def _pose(element: "Element") -> Pose:
    R = np.empty(9)
    quat = _numbers(element, "quat", "1 0 0 0")
    mujoco.mju_quat2Mat(R, quat / np.linalg.norm(quat))
    return from_rotation(R.reshape(3, 3), _numbers(element, "pos", "0 0 0"))


def _numbers(element: "Element", name: str, default: str) -> NDArray[np.float64]:
    return np.array(element.get(name, default).split(), np.float64)


def _move(element: "Element", T: Pose) -> None:
    """Give an element of a frame the pose that it has outside, where the frame has the 4×4 pose ``T``."""
    if element.tag in ("body", "geom", "site", "camera"):
        moved, quat = T @ _pose(element), np.empty(4)
        mujoco.mju_mat2Quat(quat, moved[:3, :3].ravel())
        element.set("pos", _text(moved[:3, 3]))
        element.set("quat", _text(quat))
    elif element.tag in ("joint", "light"):
        name, default = ("axis", "0 0 1") if element.tag == "joint" else ("dir", "0 0 -1")
        element.set(name, _text(T[:3, :3] @ _numbers(element, name, default)))
        element.set("pos", _text((T @ [*_numbers(element, "pos", "0 0 0"), 1.0])[:3]))


def _text(numbers: NDArray[np.float64]) -> str:
    return " ".join(map(repr, numbers.tolist()))


def _rename(root: "Element") -> None:
    """Change names with ``/``, which PyMJCF keeps for the names of a model that is joined in."""
    taken = {element.get("name", "") for element in root.iter()}
    names = dict[str, str]()
    for name in sorted(name for name in taken if "/" in name):
        new = name.replace("/", "_")
        while new in taken:
            new += "_"
        names[name] = new
        taken.add(new)
    for element in root.iter():
        for key in element.attrib.keys() - {"data", "file"}:
            element.set(key, names.get(element.attrib[key], element.attrib[key]))


def _drop_settings(root: "Element") -> None:
    """Take away what is resolved, or holds for the file alone; only the unit of angles is still said."""
    for element in [e for tag in ("compiler", "keyframe") for e in root.findall(tag)]:
        root.remove(element)
    root.insert(0, root.makeelement("compiler", {"angle": "radian"}))
    for size in root.findall("size"):
        for name in size.attrib.keys() - set(SIZES):
            del size.attrib[name]
