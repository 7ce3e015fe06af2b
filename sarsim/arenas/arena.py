"""An arena as a dm_control entity."""

from pathlib import Path

import mujoco
import numpy as np
from defusedxml import DefusedXmlException, ElementTree
from dm_control import composer, mjcf
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.transforms import from_rotation


class RescueArena(composer.Arena):
    """An arena from an MJCF file whose site ``start`` says where the robot is set down."""

    def _build(self, path: Path) -> None:
        self._mjcf_root = _parse(path)
        self._start = self._mjcf_root.find("site", "start")
        if self._start is None:
            raise InputError(f"{path}: the arena has no free start: a site named 'start' is missing")

    @property
    def T_world_start(self) -> NDArray[np.float64]:
        """4×4 pose at which the robot's ``base_link`` is set down."""
        quat = np.array([1.0, 0, 0, 0] if self._start.quat is None else self._start.quat)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, quat)
        return from_rotation(rotation.reshape(3, 3), self._start.pos)


def _parse(path: Path) -> mjcf.RootElement:
    """Read MJCF; a file from a stranger may hold an XML bomb, so entities are refused before MuJoCo sees them."""
    try:
        ElementTree.parse(path, forbid_dtd=True)
        mujoco.MjModel.from_xml_path(str(path))
        return mjcf.from_path(str(path))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except (ElementTree.ParseError, DefusedXmlException, ValueError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: not a readable MJCF file: {' '.join(str(error).split())}") from error
