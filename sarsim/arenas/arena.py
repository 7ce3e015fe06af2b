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
    """Prefix the message of an InputError raised in the context with ``name``, unless it is empty."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{name}: {error}" if name else str(error)) from error


class RescueArena(composer.Arena):
    """An arena whose site ``start`` marks where the robot starts."""

    def _build(self, root: mjcf.RootElement, called: str = "") -> None:
        """Use the MJCF ``root`` as an arena named ``called`` in messages; InputError if it has no site ``start``."""
        self._mjcf_root, self._called = root, called
        if root.find("site", "start") is None:
            raise InputError("the arena has no start; add a site named 'start' or use --start X Y YAW")

    def naming(self) -> AbstractContextManager[None]:
        """A context that prefixes the message of an InputError with the arena's name."""
        return naming(self._called)

    @property
    def T_world_start(self) -> Pose:
        """Start pose of the robot's ``base_link``."""
        start = self._mjcf_root.find("site", "start")
        quat = np.array([1.0, 0, 0, 0] if start.quat is None else start.quat)
        quat = quat / np.linalg.norm(quat)  # as MuJoCo does, because numbers in files are rounded
        return from_rotation(rotation(quat), np.zeros(3) if start.pos is None else start.pos)

    def to_xml(self) -> str:
        """The arena's MJCF, in a form that :func:`~sarsim.arenas.load.load_arena` can read.

        PyMJCF gives the global default class the name ``/`` in a file, but refuses to read a file that names it.
        """
        root = self.mjcf_model.to_xml(precision=17)
        for top in root.iterfind("default/default[@class='/']"):
            top.getparent().extend(top)
            top.getparent().remove(top)
        for element in root.iterfind(".//*[@class='/']"):
            del element.attrib["class"]
        return etree.tostring(root, encoding="unicode", pretty_print=True)
