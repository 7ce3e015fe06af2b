"""Rendering of one scene: an arena, a drive through it, and the robot's images at each keyframe."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
from dm_control import composer, mjcf
from dm_control.mujoco import wrapper
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.files import atomic_write
from pipeline.labels import Label
from pipeline.transforms import from_rotation
from sarsim.arenas.load import load_arena
from sarsim.arenas.random_arena import build_random
from sarsim.dataset import image_kernels
from sarsim.dataset.drive import EndlessDrive, WheelContact
from sarsim.dataset.manifest import SceneEntry, scene_path, sha256_of, split_of
from sarsim.dataset.recipe import RANDOM_PREFIX, Recipe, SceneRecipe
from sarsim.dataset.scene_file import NO_BOX, SceneContent, SceneFrame, SceneWriter
from sarsim.ground_truth.true_surface import Survey
from sarsim.methods.plugins import make_plugins
from sarsim.robots.names import ROBOTS, robot_file
from sarsim.robots.pose import TrajectorySample
from sarsim.robots.skid_steered import SkidSteerRobot
from sarsim.sensors.camera import RgbdCamera, geom_labels, geom_objects
from sarsim.sensors.lighting import set_lighting
from sarsim.sensors.rendering import Renderer, hidden
from sarsim.victims.victims import victims_of

PLUGIN_HOOKS = ("scene", "dataset")
"""Names of the plug-in methods that may add files to a dataset."""
MAX_ATTEMPTS = 10
"""Maximum number of random arenas drawn for a scene."""


def make_scene(recipe: Recipe, index: int, folder: Path) -> SceneEntry:
    """Make a scene's file in a dataset's folder, completely or not at all.

    Raises:
        InputError: the scene cannot be made or written.
    """
    path, plugins = folder / scene_path(index), make_plugins(recipe, PLUGIN_HOOKS)
    path.parent.mkdir(exist_ok=True)
    with atomic_write(path) as partial, ExitStack() as added:

        def watchers(world: World) -> list[Callable[[TrajectorySample], object]]:
            return [added.enter_context(plugin.scene(world, folder, index)) for plugin in plugins]

        scene, points = render_scene(recipe, index, partial, watchers=watchers)
        digest = sha256_of(partial)
    return SceneEntry(
        index=index,
        file=scene_path(index),
        split=split_of(index),
        sha256=digest,
        frames=recipe.frames,
        arena=scene.arena,
        lighting=scene.conditions.lighting.name,
        points={label.name.lower(): int(points[label]) for label in Label},
    )


def render_scene(
    recipe: Recipe,
    index: int,
    path: Path,
    on_frame: Callable[[], object] = lambda: None,
    renderer: type[Renderer] = Renderer,
    watchers: Callable[["World"], Sequence[Callable[[TrajectorySample], object]]] = lambda world: (),
) -> tuple[SceneRecipe, NDArray[np.int64]]:
    """Write scene ``index`` of a dataset to a file; the bytes depend on the recipe and the index alone.

    ``on_frame`` is called after every frame. The functions that ``watchers`` returns are called with the robot's pose
    while the robot is at this pose.

    Returns:
        The recipe of the scene, and the (8,) numbers of depth returns of each label.

    Raises:
        InputError: the arena cannot be loaded or built, or the robot cannot drive in it.
    """
    scene, arena = find_scene(recipe, index)
    with World(arena, scene, renderer, recipe.width, recipe.height) as world:
        poses = world.drive(recipe, recipe.rng(index, "drive")).poses(recipe.frames)
        noise, watching = recipe.rng(index, "noise"), watchers(world)
        with SceneWriter(path, recipe.frames, world.content()) as writer:
            for pose in poses:
                writer.write(world.capture(pose, noise))
                for watcher in watching:
                    watcher(pose)
                on_frame()
    return scene, writer.label_points


@dataclass(frozen=True)
class ArenaText:
    """An arena as MJCF, with the contents of the files to which it refers."""

    mjcf: str
    assets: dict[str, bytes]


def find_scene(recipe: Recipe, index: int) -> tuple[SceneRecipe, ArenaText]:
    """The recipe of scene ``index`` and its arena: the first candidate that can be built.

    Raises:
        InputError: the arena cannot be loaded or built.
    """
    *tried, last = recipe.candidates(index, MAX_ATTEMPTS)
    for scene in tried:
        with suppress(InputError):
            return scene, arena_of(scene)
    return last, arena_of(last)


def arena_of(scene: SceneRecipe) -> ArenaText:
    """The arena of a scene; InputError if it cannot be loaded or built."""
    if scene.random is not None:
        # The same arena as from load_arena, without the tenths of a second that PyMJCF takes to parse and write it.
        builder = build_random(int(scene.arena.removeprefix(RANDOM_PREFIX)), scene.random)
        return ArenaText(builder.to_xml(), builder.files)
    arena = load_arena(scene.arena)
    return ArenaText(arena.to_xml(), arena.mjcf_model.get_assets())


class World(ExitStack):
    """An arena with a robot that is placed at poses without physics, and the images of the robot's camera.

    Attributes:
        model: MuJoCo model of arena and robot.
        data: the model's state.
        camera: the robot's RGB-D camera.
    """

    def __init__(self, arena: ArenaText, scene: SceneRecipe, renderer: type[Renderer], width: int, height: int):
        """Build the scene's arena, to be rendered in images of ``width`` × ``height`` pixels."""
        super().__init__()
        self._scene = scene
        self._mjcf = arena.mjcf
        self.model = _with_robot(arena)
        physics, names = mjcf.Physics.from_model(wrapper.MjModel(self.model)), _robot_by_name()
        self.data: mujoco.MjData = physics.data.ptr
        set_lighting(physics, names, scene.conditions.lighting)
        self._renderer = self.enter_context(renderer(self.model, width, height))
        self.camera = RgbdCamera(self._renderer, names.camera.full_identifier)
        self._qpos_address = self.model.jnt_qposadr[self.model.body_jntadr[self.camera.base_body]]
        mujoco.mj_kinematics(self.model, self.data)
        start = self.data.site("start")
        self._T_world_start = from_rotation(start.xmat.reshape(3, 3), start.xpos)
        self._move(self._T_world_start)
        self._victims = victims_of(self.model, self.data)
        self._victim_of_geom = np.full(self.model.ngeom, NO_BOX, np.int16)
        for number, victim in enumerate(self._victims):
            self._victim_of_geom[victim.geoms] = number

    def drive(self, recipe: Recipe, rng: np.random.Generator) -> EndlessDrive:
        """A drive that begins at the arena's start."""
        survey = Survey(self.model, self.data, self.camera.base_body)
        surface = survey.surface_from(self._T_world_start[:3, 3])
        wheel_contact = WheelContact(survey.bodies, survey.grid)
        return EndlessDrive(
            surface, wheel_contact, self._T_world_start, rng, recipe.keyframes, recipe.frames_per_second
        )

    def capture(self, pose: TrajectorySample, rng: np.random.Generator) -> SceneFrame:
        """The frame that the robot sees at a pose; ``rng`` draws the errors of its sensors."""
        self._move(pose.T_world_base)
        true = self.camera.capture(self.data)
        seen = self._scene.conditions.sense(true, rng)
        boxes = np.full((len(self._victims), 4), NO_BOX, np.int32)
        areas = np.zeros(len(self._victims), np.int32)
        image_kernels.victim_boxes(true.instance, self._victim_of_geom, boxes, areas)
        return SceneFrame(seen.frame(pose.time, pose.T_odom_base), pose.T_world_base, boxes, areas)

    def unoccluded_areas(self) -> NDArray[np.int32]:
        """(V,) number of pixels that would show each victim in the last image if nothing occluded it."""
        areas = np.zeros(len(self._victims), np.int32)
        for number, victim in enumerate(self._victims):
            with hidden(self.model, ~np.isin(np.arange(self.model.ngeom), victim.geoms)):
                geom, _ = self._renderer.segmentation_and_depth(self.data, self.camera.camera_id)
            areas[number] = np.count_nonzero(geom >= 0)
        return areas

    def content(self) -> SceneContent:
        """The content of the scene's file without the frames."""
        model, victims = self.model, self._victims
        return SceneContent(
            settings=self._scene.as_json(),
            mjcf=self._mjcf,
            intrinsics=self.camera.intrinsics,
            geom_name=[model.geom(geom).name for geom in range(model.ngeom)],
            geom_label=geom_labels(model),
            geom_victim=self._victim_of_geom,
            geom_object=geom_objects(model)[:-1].astype(np.int16),
            victim_id=[victim.id for victim in victims],
            victim_pose=np.array([victim.T_world_victim for victim in victims]).reshape(-1, 4, 4),
            victim_box=np.array([victim.box for victim in victims]).reshape(-1, 2, 3),
        )

    def _move(self, T_world_base: NDArray[np.float64]) -> None:
        """Set the robot's pose, and compute the poses of its camera and lamp; nothing is simulated."""
        qpos = self.data.qpos[self._qpos_address : self._qpos_address + 7]
        qpos[:3] = T_world_base[:3, 3]
        mujoco.mju_mat2Quat(qpos[3:], np.ascontiguousarray(T_world_base[:3, :3]).ravel())
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)


def _with_robot(text: ArenaText) -> mujoco.MjModel:
    """Compile arena and robot into one model; the robot's parts get the names that dm_control would give them."""
    arena = mujoco.MjSpec.from_string(text.mjcf, assets=text.assets)
    robot = mujoco.MjSpec.from_file(str(robot_file(ROBOTS[0])))
    # Contacts are not simulated here, but MuJoCo would warn if arena and robot differed in these solver options.
    robot.option.cone, robot.option.impratio = arena.option.cone, arena.option.impratio
    arena.attach(robot, prefix=f"{robot.modelname}/", frame=arena.worldbody.add_frame())
    arena.body(f"{robot.modelname}/base_link").add_freejoint()
    return arena.compile()


@cache
def _robot_by_name() -> SkidSteerRobot:
    """The robot in an empty arena, for the names of its parts."""
    robot = SkidSteerRobot()
    composer.Arena().add_free_entity(robot)
    return robot
