"""An arena as a dm_control entity."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

import numpy as np
from dm_control import composer, mjcf
from lxml import etree

from pipeline.arrays import Pose
from pipeline.errors import InputError
from pipeline.transforms import from_rotation
from sarsim.ground_truth.shapes import rotation


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Put a name, if there is one, before the message of an InputError."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{name}: {error}" if name else str(error)) from error


class RescueArena(composer.Arena):
    """An arena whose site ``start`` marks where the robot is set down."""

    def _build(self, root: mjcf.RootElement, called: str = "") -> None:
        """``root``: its MJCF; ``called``: its name in error messages. InputError if the site is missing."""
        self._mjcf_root, self._called = root, called
        if root.find("site", "start") is None:
            raise InputError("the arena has no start: add a site named 'start', or give --start X Y YAW")

    def naming(self) -> AbstractContextManager[None]:
        """A context that puts the arena's name before the message of an InputError."""
        return naming(self._called)

    @property
    def T_world_start(self) -> Pose:
        """Pose at which the robot's ``base_link`` is set down."""
        start = self._mjcf_root.find("site", "start")
        quat = np.array([1.0, 0, 0, 0] if start.quat is None else start.quat)
        quat = quat / np.linalg.norm(quat)  # as MuJoCo does: a file has few digits
        return from_rotation(rotation(quat), np.zeros(3) if start.pos is None else start.pos)

    def to_xml(self) -> str:
        """Its MJCF, which :func:`~sarsim.arenas.load.load_arena` reads again.

        PyMJCF calls the class of defaults that counts everywhere ``/`` and refuses a file in which it has a name.
        """
        root = self.mjcf_model.to_xml(precision=17)
        for top in root.iterfind("default/default[@class='/']"):
            top.getparent().extend(top)
            top.getparent().remove(top)
        for element in root.iterfind(".//*[@class='/']"):
            del element.attrib["class"]
        return etree.tostring(root, encoding="unicode", pretty_print=True)
