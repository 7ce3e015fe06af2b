"""Converts MJCF with MuJoCo's compiler to a form that has the same meaning alone and merged with another file.

An MJCF file contains settings for its reader: the unit of angles, the method of computing inertias, folders,
defaults, included and attached files, frames and copies. If two files are merged, the settings of one file also
affect the other file. Therefore, MuJoCo reads each file alone and writes it with values that depend on no setting:
radians and quaternions, explicit inertias, and every attribute on its own element.
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

FLOAT64_DIGITS = 17  # Digits that preserve a float64 exactly
PATHS = {"mesh": "mesh_pathadr", "hfield": "hfield_pathadr", "texture": "tex_pathadr", "skin": "skin_pathadr"}
"""Elements with a file, each with the array of the compiled model that gives the addresses of the files' paths."""
_Classes = dict[str, dict[str, dict[str, str]]]
"""For each default class, the attributes, by name, of each kind of element."""
Check = Callable[[mujoco.MjModel], None]
"""A function that raises InputError if a compiled model must not be used."""
_TOP = "main"
"""MuJoCo's name for the global default class."""
DEFAULTS_OF = {"equality": "equality", "tendon": "tendon", "actuator": "general"}
"""Sections in which all elements have the same tag in default classes, each with this tag."""
SIZES = (
    "nuserdata",
    *(f"nuser_{kind}" for kind in ("body", "jnt", "geom", "site", "cam", "tendon", "actuator", "sensor")),
)
"""Attributes of ``<size>`` that are still needed after a merge."""


def _no_check(model: mujoco.MjModel) -> None: ...


def resolved(path: Path, check: Check = _no_check) -> tuple[mujoco.MjModel, mjcf.RootElement]:
    """A compiled model, and MJCF that has the same meaning alone and merged with another file.

    Args:
        path: the MJCF file.
        check: function that raises InputError if the compiled model must not be written as MJCF.

    Raises:
        InputError: the file is missing, MuJoCo or PyMJCF cannot read it, or ``check`` rejects it.
    """
    with _one_line("cannot be read as MJCF"):
        return _resolved(mujoco.MjSpec.from_file(str(path)), lambda name: Path(name).read_bytes(), path.parent, check)


def resolved_root(root: mjcf.RootElement, name: str) -> tuple[mujoco.MjModel, mjcf.RootElement]:
    """Like :func:`resolved`, for MJCF created by other code; an InputError begins with ``name``."""
    files = root.get_assets()
    with _one_line(f"{name}: MuJoCo cannot compile the arena"):
        spec = mujoco.MjSpec.from_string(root.to_xml_string(precision=FLOAT64_DIGITS), assets=files)
        return _resolved(spec, files.__getitem__, Path())


@contextmanager
def _one_line(beginning: str) -> Iterator[None]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # The warnings concern settings that MuJoCo will drop
            yield
    except InputError:
        raise
    except (OSError, ValueError, KeyError, AttributeError, mujoco.FatalError) as error:
        raise InputError(f"{beginning}: {' '.join(str(error).split())}") from error


def _resolved(
    spec: mujoco.MjSpec, read: Callable[[str], bytes], folder: Path, check: Check = _no_check
) -> tuple[mujoco.MjModel, mjcf.RootElement]:
    spec.compiler.saveinertial = True
    spec.compiler.fusestatic = False  # Fusing would only remove the names of bodies
    spec.compiler.alignfree = False
    for joint in spec.joints:
        joint.align = mujoco.mjtAlignFree.mjALIGNFREE_AUTO  # This moves the frame of a body, but nothing in it
    model = spec.compile()
    check(model)
    root = _written(spec)
    _set_options(root, spec)
    files = _rename_files(root, model, spec, read, folder)
    _apply_defaults(root)
    for body in [body for tag in ("worldbody", "body") for body in root.iter(tag)]:
        _dissolve_frames(body)
    for text in root.iterfind("custom/text"):
        if text.text and "data" not in text.attrib:  # MuJoCo writes text with special characters like this
            text.set("data", text.text)
    _rename_slashed(root)
    _drop_settings(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return model, mjcf.from_xml_string(text, assets=files)


def _written(spec: mujoco.MjSpec) -> "Element":
    """A compiled spec as XML with full precision; MuJoCo's default, six digits, errs by up to 0.5 mm at 100 m."""
    (path,) = Path(mujoco.__file__).parent.glob("libmujoco.*")
    library = ctypes.CDLL(str(path))
    before = library._mjPRIVATE__get_xml_precision()
    library._mjPRIVATE__set_xml_precision(FLOAT64_DIGITS)
    try:
        with TemporaryDirectory() as folder:
            spec.to_file(f"{folder}/model.xml")  # Not to a string: names need not be UTF-8
            return root_of(Path(folder, "model.xml").read_bytes())
    finally:
        library._mjPRIVATE__set_xml_precision(before)


def _set_options(root: "Element", spec: mujoco.MjSpec) -> None:
    """Write the options that the file sets, including options set to MuJoCo's defaults."""
    compiler = spec.compiler
    compiler.savecompiled = compiler.savecanonical = False
    authored = _written(spec).find("option")
    for option in root.findall("option"):
        root.remove(option)
    if authored is not None:
        root.append(authored)


def _rename_files(
    root: "Element", model: mujoco.MjModel, spec: mujoco.MjSpec, read: Callable[[str], bytes], folder: Path
) -> dict[str, bytes]:
    """Give the files that MuJoCo opened unique names in the elements; return the files' contents by these names."""
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
    """Write the attributes of the default classes into the elements, and remove the classes."""
    classes: _Classes = {_TOP: {}}
    for top in root.findall("default"):
        _collect_classes(top, {}, classes)
        root.remove(top)
    for section in root:
        _fill_in_defaults(section, section.tag, _TOP, classes)


def _collect_classes(default: "Element", inherited: Mapping[str, dict[str, str]], classes: _Classes) -> None:
    """Add a class and its subclasses to ``classes``, each with its attributes for each kind of element."""
    own = {tag: dict(attributes) for tag, attributes in inherited.items()}
    for child in default:
        if child.tag != "default":
            own.setdefault(child.tag, {}).update(child.attrib)
    classes[default.get("class", _TOP)] = own
    for child in default.iterfind("default"):
        _collect_classes(child, own, classes)


def _fill_in_defaults(parent: "Element", section: str, childclass: str, classes: _Classes) -> None:
    childclass = parent.attrib.pop("childclass", childclass)
    for child in parent:
        own = classes[child.attrib.pop("class", childclass)].get(DEFAULTS_OF.get(section, child.tag), {})
        child.attrib.update({name: text for name, text in own.items() if name not in child.attrib})
        _fill_in_defaults(child, section, childclass, classes)


def _dissolve_frames(body: "Element") -> None:
    """Move the content of a body's frames into the body itself, in the same order."""
    for frame in body.findall("frame"):
        _dissolve_frames(frame)
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
    """Convert the pose of an element in a frame with the 4×4 pose ``T`` to a pose in the frame's parent."""
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


def _rename_slashed(root: "Element") -> None:
    """Change names that contain ``/``, which PyMJCF reserves for the names of attached models."""
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
    """Remove settings that are resolved or apply only to the file; for the compiler, set only the unit of angles."""
    for element in [e for tag in ("compiler", "keyframe") for e in root.findall(tag)]:
        root.remove(element)
    root.insert(0, root.makeelement("compiler", {"angle": "radian"}))
    for size in root.findall("size"):
        for name in size.attrib.keys() - set(SIZES):
            del size.attrib[name]
