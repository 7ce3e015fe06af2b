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
def prefixing_errors(name: str) -> Iterator[None]:
    """If ``name`` is not empty, prepend it to the message of any InputError raised in the context."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{name}: {error}" if name else str(error)) from error


class RescueArena(composer.Arena):
    """An arena with a site ``start`` that marks the robot's start pose."""

    def _build(self, root: mjcf.RootElement, called: str = "") -> None:
        """Use the MJCF ``root`` as the arena.

        Args:
            root: the ``<mujoco>`` element.
            called: name of the arena in error messages.

        Raises:
            InputError: ``root`` has no site ``start``.
        """
        self._mjcf_root, self._called = root, called
        if root.find("site", "start") is None:
            raise InputError("the arena has no start; add a site named 'start' or use --start X Y YAW")

    def prefixing_errors(self) -> AbstractContextManager[None]:
        """A context manager that prepends the arena's name to the message of any InputError."""
        return prefixing_errors(self._called)

    @property
    def T_world_start(self) -> Pose:
        """Start pose of the robot's ``base_link`` in the world."""
        start = self._mjcf_root.find("site", "start")
        quat = np.array([1.0, 0, 0, 0] if start.quat is None else start.quat)
        quat = quat / np.linalg.norm(quat)  # as in MuJoCo, because numbers in files are rounded
        return from_rotation(rotation(quat), np.zeros(3) if start.pos is None else start.pos)

    def to_xml(self) -> str:
        """The arena's MJCF, in a form that :func:`~sarsim.arenas.load.load_arena` can read.

        PyMJCF names the global default class ``/`` in a file, but refuses to read such a file. The name is therefore
        removed.
        """
        root = self.mjcf_model.to_xml(precision=17)
        for top in root.iterfind("default/default[@class='/']"):
            top.getparent().extend(top)
            top.getparent().remove(top)
        for element in root.iterfind(".//*[@class='/']"):
            del element.attrib["class"]
        return etree.tostring(root, encoding="unicode", pretty_print=True)
