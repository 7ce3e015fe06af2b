"""The transforms between the frames of a robot."""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Pose
from pipeline.datasets.messages import BASE, ODOM, Message, pose_matrix, seconds
from pipeline.transforms import inverse

TF_TYPES = "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"  # The latter is an older type of ROS 1
FOOTPRINT = "base_footprint"  # On the ground, while a robot's ``base_link`` may be higher (REP 120)
BASES = BASE, FOOTPRINT
"""Names of a robot's own frame (REP 105 and 120), the preferred one first."""
MOTION_TOLERANCE = 1e-3  # Maximum change of a transform's elements that is attributed to rounding, not to motion


class CameraMount(NamedTuple):
    """The pose of a camera on a robot.

    Attributes:
        T_base_camera: pose of the camera in ``base_link``; None if no chain of transforms connects the two frames.
        T_driven_base: pose of the pipeline's ``base_link``, which is on the ground, in the frame whose odometry is
            recorded.
        note: one line about assumptions and unexpected frames; empty if all frames are as expected.
    """

    T_base_camera: Pose | None
    T_driven_base: Pose
    note: str


def tf_topics(kinds: Mapping[str, str], robot_topics: Sequence[str]) -> list[str]:
    """The topics of a robot's transforms, recognised by their type, because their names may have a namespace.

    Args:
        kinds: the types of all topics, by name.
        robot_topics: other topics of the robot. If several namespaces have transforms, only the namespaces that
            contain these topics are used.
    """
    spaces = {name: name.rpartition("/")[0] for name, kind in kinds.items() if kind in TF_TYPES}
    own = {space for space in spaces.values() if space and any(name.startswith(f"{space}/") for name in robot_topics)}
    others = set(spaces.values()) - {""}
    used = (own or (others if len(others) == 1 else set())) | {""}
    return [name for name, space in spaces.items() if space in used]


class FrameTree:
    """Transforms between frames, which are identified by name.

    A frame may have several parents, for example if a robot's transforms and those of a motion capture system share a
    topic. The parent that leads to the robot is then used, or else the newest parent.

    Attributes:
        base: name of the robot's frame according to its odometry messages; empty if they do not name a frame.
    """

    def __init__(self, kept: int | None = None) -> None:
        """Start without transforms; ``kept``: maximum number of poses in the odometry of a frame, by default all."""
        self.base = ""
        self._links: dict[str, dict[str, Pose]] = {}  # by child and parent, the newest parent last
        self._first: dict[tuple[str, str], Pose] = {}  # by child and parent
        self._moving: set[str] = set()
        self._kept = kept
        self._odometry: dict[str, deque[tuple[float, Pose]]] = {}

    def take(self, message: Message, time: float = 0.0) -> None:
        """Store a TransformStamped; ``time``, s, is used if it has no stamp.

        A transform that is not finite is stored only among the poses of the odometry, if its parent is ``odom``.
        """
        T = pose_matrix(message.transform.translation, message.transform.rotation)
        parent, child = message.header.frame_id.strip("/"), message.child_frame_id.strip("/")
        if _matches(parent, ODOM):
            poses = self._odometry.setdefault(child, deque(maxlen=self._kept))
            poses.append((seconds(message.header.stamp) or time, T))
        if not np.isfinite(T).all():
            return
        if not np.allclose(self._first.setdefault((child, parent), T), T, rtol=0, atol=MOTION_TOLERANCE):
            self._moving.add(child)
        self.set_transform(child, parent, T)

    def set_transform(self, child: str, parent: str, T_parent_child: Pose) -> None:
        """Store the pose of a frame in its parent."""
        parents = self._links.setdefault(child, {})
        parents.pop(parent, None)
        parents[parent] = T_parent_child

    def odometry(self, camera: str) -> list[tuple[float, Pose]]:
        """Times, s, and poses in ``odom`` of the frame that carries a camera and whose parent is ``odom``."""
        return list(self._odometry.get(self._driven(camera), ()))

    def _driven(self, camera: str) -> str:
        """The child of ``odom`` that carries the camera, or else the only child; empty if there is none."""
        above = [name for name, _ in self._with_ancestors(self.named(camera)) if name in self._odometry]
        return next(iter(above or (self._odometry if len(self._odometry) == 1 else ())), "")

    @property
    def has_moving_frames(self) -> bool:
        """Whether any frame has moved relative to its parent."""
        return bool(self._moving)

    def knows(self, frame: str) -> bool:
        """Whether a frame is known by a given name, or by a name that differs only in a leading namespace."""
        return self.named(frame) in self._known_frames()

    def mount(self, camera: str) -> CameraMount:
        """The pose of a camera on the robot, with a note if a frame has an unexpected name."""
        named, base, expected = self.named(camera), self._base(camera), self._expected_base(camera)
        T = self.between(base, named)
        if T is None:
            wanted = f"no transform connects {expected} to the camera frame {camera or '(unnamed)'}"
            return CameraMount(None, np.eye(4), f"{wanted} (transforms found: {self})")
        pairs = (base, expected), (named, camera.strip("/"))
        taken = [f"using the frame {found} as {wanted}" for found, wanted in pairs if found != wanted]
        moving = [name for name in self._names_up_to(base, named) if name in self._moving]
        for name in self._names_up_to(base, named):
            if len(self._links.get(name, {})) > 1:
                parents = " and ".join(sorted(self._links[name]))
                taken.append(f"the frame {name} has the parents {parents} by turns; using {self._parent(name)}")
        taken += [f"the frame {name} moves relative to the robot; using its last pose" for name in moving]
        ground = self._T_base_ground(base)
        return CameraMount(inverse(ground) @ T, ground, "; ".join(taken))

    def T_base(self, frame: str, camera: str) -> Pose | None:
        """Pose of a frame in ``base_link`` of the robot that carries a camera; None if no transforms connect them."""
        base = self._base(camera)
        T = self.between(base, self.named(frame))
        return None if T is None else inverse(self._T_base_ground(base)) @ T

    def _T_base_ground(self, base: str) -> Pose:
        """Pose of ``base_footprint`` in the robot's frame if it is fixed to the robot; otherwise the identity."""
        feet = [name for name in self._known_frames() if _matches(name, FOOTPRINT)]
        rigid = [T for name in feet if (T := self._rigid_transform(base, name)) is not None]
        return rigid[0] if len(rigid) == 1 else np.eye(4)

    def _rigid_transform(self, frame: str, other: str) -> Pose | None:
        """Pose of ``other`` in ``frame`` if one frame is an ancestor of the other and fixed to it; otherwise None."""
        ways = [[name for name, _ in self._with_ancestors(end)] for end in (frame, other)]
        for way, top in zip(ways, (other, frame), strict=True):
            if top in way and not self._moving & set(way[: way.index(top)]):
                return self.between(frame, other)
        return None

    def _expected_base(self, camera: str) -> str:
        """The expected name of the robot's frame: from the odometry messages, from transforms, or ``base_link``."""
        return self.base.strip("/") or self._driven(camera) or BASE

    def _base(self, camera: str) -> str:
        """The robot's frame that carries the camera: the expected frame, or else the topmost with a usual name."""
        expected, named = self.named(self._expected_base(camera)), self.named(camera)
        if self.between(expected, named) is not None:
            return expected
        above = [name for name, _ in self._with_ancestors(named)][::-1]
        return next((name for usual in BASES for name in above if _matches(name, usual)), expected)

    def _known_frames(self) -> set[str]:
        return self._links.keys() | {parent for parents in self._links.values() for parent in parents}

    def _parent(self, child: str) -> str:
        """The parent that is used for a frame: the newest that leads to the robot, or else the newest of all."""
        parents = list(self._links[child])[::-1]
        robots = [parent for parent in parents if self._leads_to_robot(parent, child)] if parents[1:] else []
        return (robots or parents)[0]

    def _leads_to_robot(self, frame: str, child: str) -> bool:
        """Whether a frame or one of its ancestors is the robot's own, on a path that does not contain ``child``."""
        passed, ahead = {child}, {frame}
        while ahead:
            if any(self._is_robot_frame(name) for name in ahead):
                return True
            passed |= ahead
            ahead = {parent for name in ahead for parent in self._links.get(name, {})} - passed
        return False

    def _is_robot_frame(self, frame: str) -> bool:
        is_driven = frame == self.base.strip("/") or frame in self._odometry
        return is_driven or any(_matches(frame, name) for name in BASES)

    def named(self, frame: str) -> str:
        """The known name of a frame: its given name, or the only name that differs only in a leading namespace."""
        frame = frame.strip("/")
        known = self._known_frames()
        alike = [name for name in known if name.endswith(f"/{frame}") or frame.endswith(f"/{name}")]
        return alike[0] if frame and frame not in known and len(alike) == 1 else frame

    def has_parent(self, frame: str) -> bool:
        """Whether a frame has a parent."""
        return self.named(frame) in self._links

    def between(self, frame: str, other: str) -> Pose | None:
        """Pose of ``other`` in ``frame``; None without a common ancestor in which ``frame`` does not move."""
        frame, other = frame.strip("/"), other.strip("/")
        above: dict[str, Pose] = {}
        for name, T in self._with_ancestors(frame):
            above[name] = T
            if name in self._moving:
                break
        found = next(((name, T) for name, T in self._with_ancestors(other) if name in above), None)
        return None if found is None else inverse(above[found[0]]) @ found[1]

    def _names_up_to(self, base: str, frame: str) -> list[str]:
        """The names of a frame and its ancestors below the robot's frame."""
        names = [name for name, _ in self._with_ancestors(frame)]
        return names[: names.index(base)] if base in names else names

    def _with_ancestors(self, frame: str) -> Iterator[tuple[str, Pose]]:
        """The names of a frame and of its ancestors, and the frame's pose in each."""
        name, T = frame.strip("/"), np.eye(4)
        yield name, T
        for _ in range(len(self._links)):
            if name not in self._links:
                return
            parent = self._parent(name)
            name, T = parent, self._links[name][parent] @ T
            yield name, T

    def __str__(self) -> str:
        """Each parent with its children."""
        children: dict[str, list[str]] = {}
        for child, parents in self._links.items():
            for parent in parents:
                children.setdefault(parent, []).append(child)
        return ", ".join(f"{parent} → {' '.join(names)}" for parent, names in children.items()) or "none"


def _matches(name: str, expected: str) -> bool:
    """Whether a name is the ``expected`` name, possibly with a prefix."""
    return name == expected or name.endswith((f"/{expected}", f"_{expected}"))
