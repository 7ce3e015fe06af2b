"""Falling people: the CMU humanoid as a ragdoll that comes to rest on a floor, against a wall or on a block."""

from dataclasses import dataclass

import mujoco
import numpy as np
from dm_control import mjcf
from dm_control.locomotion.walkers import cmu_humanoid
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scripts.assets.victims.surface import Primitive

# The root's x points to the person's left, y up and z forward; in the world, z is up and the person faces +x.
UPRIGHT = Rotation.from_matrix([(0, 0, 1), (1, 0, 0), (0, 1, 0)])
TIMESTEP = 0.003
FALL, REST = 1.5, 2.0
"""Durations, s: of the fall, and of the settling that follows, after which the ragdoll must be at rest."""
DENSITY = 500.0  # kg/m³; because the primitives overlap, half the density of a body gives 75 kg
SEAT_BLOCK = (0.26, 0.3, 0.25)  # Half sizes of the block to sit on, m


@dataclass(frozen=True)
class Setup:
    """How to produce a posture, and the conditions that must hold at rest.

    Attributes:
        turn: mean rotation about the person's own x, y, z before the fall, degrees.
        spread: standard deviation of these angles, degrees.
        height: height of the root above the floor before the fall, m.
        hips, knees, elbows: minimum and maximum flexion, degrees.
        closed: minimum and maximum angle by which each leg turns inwards, degrees; unturned legs are 40° apart.
        arms: minimum and maximum angle of the arms downwards (90 hanging, −90 up), then forwards, degrees.
        drawn_up: fraction of the knee flexion that is added to the hips', so that the feet stay on the floor.
        strength: relative stiffness with which the spine and the hips hold the posture during the fall.
        rest_strength: the same while the ragdoll settles.
        wall: x of the root before the fall, in front of a wall whose surface is at x = 0, m; 0 if there is no wall.
        block: whether the person must come to rest on a block in front of the wall.
        width: maximum extent of the bones' origins along y at rest, m.
        chest_up, chest_forward: minimum and maximum z of the chest's up and forward unit vectors at rest.
    """

    turn: tuple[float, float, float]
    spread: tuple[float, float, float]
    height: float
    hips: tuple[float, float]
    knees: tuple[float, float]
    arms: tuple[tuple[float, float], tuple[float, float]]
    drawn_up: float
    strength: float
    rest_strength: float
    elbows: tuple[float, float] = (5, 70)
    closed: tuple[float, float] = (6, 20)
    width: float = np.inf
    wall: float = 0
    block: bool = False
    chest_up: tuple[float, float] = (-1, 1)
    chest_forward: tuple[float, float] = (-1, 1)


RECIPES = {
    "lying": Setup((-90, 0, 0), (8, 10, 8), 0.3, (0, 40), (5, 60), ((35, 105), (-5, 30)), 0, 1, 1,
                    chest_up=(-0.4, 0.4), chest_forward=(0.8, 1)),
    "straight": Setup((-90, 0, 0), (2, 3, 2), 0.05, (0, 12), (0, 15), ((77, 82), (-3, 6)), 0, 2, 2,
                       elbows=(0, 8), closed=(18, 21), width=0.82, chest_up=(-0.4, 0.4), chest_forward=(0.8, 1)),
    "prone": Setup((90, 0, 0), (8, 10, 8), 0.3, (0, 30), (5, 50), ((-80, 70), (-10, 40)), 0, 1, 1,
                    chest_up=(-0.4, 0.4), chest_forward=(-1, -0.8)),
    "side": Setup((0, 0, 90), (8, 10, 5), 0.3, (40, 80), (50, 100), ((20, 80), (40, 90)), 0, 3, 2,
                   chest_up=(-0.45, 0.45), chest_forward=(-0.6, 0.6)),
    "sitting": Setup((-12, 0, 0), (3, 8, 3), 0.2, (74, 86), (15, 120), ((65, 90), (0, 45)), 0.5, 40, 40, wall=0.27,
                      chest_up=(0.85, 1), chest_forward=(-0.5, 0.5)),
    "slumped": Setup((-12, 0, 10), (3, 20, 8), 0.2, (70, 86), (5, 60), ((65, 90), (0, 45)), 0.5, 20, 3, wall=0.27,
                      chest_up=(0.3, 0.85), chest_forward=(-0.8, 0.8)),
    "seated": Setup((-8, 0, 0), (3, 8, 3), 0.66, (88, 98), (75, 95), ((65, 90), (0, 40)), 0, 40, 25, wall=0.27,
                     block=True, chest_up=(0.6, 1), chest_forward=(-0.8, 0.5)),
}  # fmt: skip


class Ragdoll:
    """The humanoid without actuators, its geoms shaped like a person's primitives."""

    def __init__(self, primitives: list[Primitive], recipe: Setup):
        scene, self._root = _scene(recipe)
        bodies = _dress(self._root, primitives)
        self.physics = mjcf.Physics.from_mjcf_model(scene)
        _exclude_neighbours(scene, self.physics)
        self.physics = mjcf.Physics.from_mjcf_model(scene)
        self._recipe = recipe
        self._bones = [bodies[name] for name in dict.fromkeys(p.bone for p in primitives)]
        rest = rest_poses(("lhumerus", "rhumerus"))[:, 3:]
        self._arms = dict(zip("lr", Rotation.from_quat(rest, scalar_first=True), strict=True))
        self._joints = {joint.name: self.physics.bind(joint) for joint in self._root.find_all("joint")}

    @property
    def bone_poses(self) -> NDArray[np.float64]:
        """(B, 7) position and quaternion of the bones, in the order in which they first appear in the primitives."""
        bound = self.physics.bind(self._bones)
        return np.concatenate([bound.xpos, bound.xquat], axis=1)

    def fall(self, rng: np.random.Generator) -> bool:
        """Pose the ragdoll at random, let it fall, and return whether it came to rest as its recipe requires."""
        physics, recipe = self.physics, self._recipe
        physics.reset()
        self._pose(rng)
        self._run(FALL)
        self._relax()
        self._run(REST)
        if recipe.block and not self._is_on_block():
            return False
        chest = physics.bind(self._root.find("body", "thorax")).xmat.reshape(3, 3)
        up, forward = chest[2, 1], chest[2, 2]
        return bool(
            np.abs(physics.data.qvel).max() < 0.3
            and physics.data.contact.dist.min(initial=0) > -0.015
            and np.ptp(self.bone_poses[:, 1]) < recipe.width
            and recipe.chest_up[0] <= up <= recipe.chest_up[1]
            and recipe.chest_forward[0] <= forward <= recipe.chest_forward[1]
        )

    def _is_on_block(self) -> bool:
        x, _, z = self.physics.data.qpos[:3]
        return bool(x < 1.5 * SEAT_BLOCK[0] and z > 2 * SEAT_BLOCK[2])

    def _pose(self, rng: np.random.Generator) -> None:
        recipe, qpos = self._recipe, self.physics.data.qpos
        turn = Rotation.from_euler("YXZ", rng.normal(recipe.turn, recipe.spread)[[1, 0, 2]], degrees=True)
        start = UPRIGHT * turn
        qpos[:3] = recipe.wall, 0, recipe.height
        qpos[3:7] = np.roll(start.as_quat(), 1)
        for name, angle in self._angles(rng).items():
            joint = self._joints[name]
            angle = np.clip(angle, *joint.range)
            joint.qpos = angle
            joint.qpos_spring = angle
            joint.stiffness = self._stiffness(name, self._recipe.strength)
        self._push_clear()

    def _push_clear(self) -> None:
        """Move the root along the normal of the deepest contact until the body is clear of floor, wall and block."""
        physics, bodies = self.physics, self.physics.model.geom_bodyid
        for _ in range(200):
            mujoco.mj_forward(physics.model.ptr, physics.data.ptr)
            contacts = [c for c in physics.data.contact if 0 in bodies[[c.geom1, c.geom2]]]
            deepest = min(contacts, key=lambda c: c.dist, default=None)
            if deepest is None or deepest.dist > -0.002:
                break
            away = 1 if bodies[deepest.geom1] == 0 else -1  # the normal points from geom1 to geom2
            physics.data.qpos[:3] += away * deepest.frame[:3] * (0.001 - deepest.dist)

    def _angles(self, rng: np.random.Generator) -> dict[str, float]:
        """Random angle of each joint, radians."""
        recipe = self._recipe
        angles = {name: rng.normal(0, 0.12) for name in sorted(self._joints)}
        for side, sign in (("l", 1), ("r", -1)):
            hip, knee = np.radians(rng.uniform(*recipe.hips)), np.radians(rng.uniform(*recipe.knees))
            angles[f"{side}femurrx"], angles[f"{side}tibiarx"] = -hip - recipe.drawn_up * knee, knee
            angles[f"{side}femurrz"] = -sign * np.radians(rng.uniform(*recipe.closed))
            angles[f"{side}radiusrx"] = np.radians(rng.uniform(*recipe.elbows))
            angles[f"{side}fingersrx"] = np.radians(rng.uniform(10, 45))
            angles[f"{side}wristry"] = sign * np.radians(rng.uniform(40, 140))
            down, forward = (np.radians(rng.uniform(*span)) for span in recipe.arms)
            angles |= _arm_angles(side, self._arms[side], -sign * down, forward)
        return angles

    def _relax(self) -> None:
        """Give the joints their stiffness at rest, which keeps them away from their limits."""
        for name, joint in self._joints.items():
            joint.stiffness = self._stiffness(name, self._recipe.rest_strength)

    def _stiffness(self, name: str, strength: float) -> float:
        if any(part in name for part in ("back", "thorax", "neck", "head")):
            return 12.0 * strength
        return 6.0 * strength if "femur" in name else 2.5 if "humerus" in name else 1.5

    def _run(self, seconds: float) -> None:
        for _ in range(round(seconds / TIMESTEP)):
            mujoco.mj_step(self.physics.model.ptr, self.physics.data.ptr)


def rest_poses(bones: tuple[str, ...]) -> NDArray[np.float64]:
    """(B, 7) position and quaternion of bones with all joints at 0, in the root's frame."""
    physics = mjcf.Physics.from_mjcf_model(cmu_humanoid.CMUHumanoidPositionControlledV2020().mjcf_model)
    data = physics.data
    ids = [physics.model.body(bone).id for bone in bones]
    return np.concatenate([data.xpos[ids], data.xquat[ids]], axis=1)


def _scene(recipe: Setup) -> tuple[mjcf.RootElement, mjcf.RootElement]:
    scene = mjcf.RootElement()
    scene.option.timestep = TIMESTEP
    scene.option.integrator = "implicitfast"
    scene.default.geom.solref = (0.006, 1)
    scene.default.geom.solimp = (0.95, 0.99, 0.001, 0.5, 2)
    scene.worldbody.add("geom", type="plane", size=(5, 5, 0.1), friction=(0.9, 0.01, 0.001))
    if recipe.wall:
        scene.worldbody.add("geom", type="box", size=(0.1, 3, 2), pos=(-0.1, 0, 2))
    if recipe.block:
        scene.worldbody.add("geom", type="box", size=SEAT_BLOCK, pos=(SEAT_BLOCK[0], 0, SEAT_BLOCK[2]))
    root = cmu_humanoid.CMUHumanoidPositionControlledV2020().mjcf_model
    for unwanted in ("actuator", "sensor", "geom", "site", "camera", "light", "tendon"):
        for element in root.find_all(unwanted):
            element.remove()
    for joint in root.find_all("joint"):
        joint.damping, joint.armature = 4.0, 0.02
    scene.attach(root).add("freejoint")
    return scene, root


def _dress(root: mjcf.RootElement, primitives: list[Primitive]) -> dict[str, mjcf.Element]:
    """Give the bones' bodies geoms shaped like their primitives; returns the bodies by name."""
    names = tuple(dict.fromkeys(p.bone for p in primitives))
    bodies = {name: root.find("body", name) for name in names}
    rest = dict(zip(names, rest_poses(names), strict=True))
    for primitive in primitives:
        T = rest[primitive.bone]
        turn = Rotation.from_quat(np.roll(T[3:], -1)).inv()
        if primitive.centre.ndim == 2:
            ends = turn.apply(primitive.centre - T[:3])
            shape = {"type": "capsule", "fromto": ends.ravel(), "size": [primitive.radii.mean()]}
        else:
            pos, quat = turn.apply(primitive.centre - T[:3]), np.roll(turn.as_quat(), 1)
            shape = {"type": "ellipsoid", "pos": pos, "quat": quat, "size": primitive.radii}
        bodies[primitive.bone].add("geom", condim=3, density=DENSITY, friction=(0.9, 0.01, 0.001), **shape)
    return bodies


def _exclude_neighbours(scene: mjcf.RootElement, physics: mjcf.Physics) -> None:
    """Exclude collisions between bodies that touch when all joints are at 0: their shapes overlap by design."""
    physics.data.qpos[2] = 30.0  # away from floor and wall
    mujoco.mj_forward(physics.model.ptr, physics.data.ptr)
    model = physics.model
    pairs = {tuple(sorted(model.geom_bodyid[[c.geom1, c.geom2]])) for c in physics.data.contact}
    for first, second in sorted(pairs):
        scene.contact.add("exclude", body1=model.body(first).name, body2=model.body(second).name)


def _arm_angles(side: str, rest: Rotation, down: float, forward: float) -> dict[str, float]:
    """Angles of the shoulder hinges that turn the outstretched arm down about z, then forward about x."""
    turn = Rotation.from_euler("zx", (down, -forward))
    rz, ry, rx = (rest.inv() * turn * rest).as_euler("ZYX")
    return {f"{side}humerusrz": rz, f"{side}humerusry": ry, f"{side}humerusrx": rx}
