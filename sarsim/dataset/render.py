"""Makes one scene: an arena, a drive through it, and what the robot sees at each look."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import mujoco
import numpy as np
from dm_control import mjcf
from numpy.typing import NDArray

from pipeline.errors import InputError
from sarsim.arenas.arena import RescueArena
from sarsim.arenas.load import load_arena
from sarsim.camera import RgbdCamera, geom_labels
from sarsim.dataset import image_kernels
from sarsim.dataset.drive import Drive, Station
from sarsim.dataset.footing import Footing
from sarsim.dataset.recipe import Recipe, SceneRecipe
from sarsim.dataset.scene_file import NO_BOX, SceneContent, SceneFrame, SceneWriter
from sarsim.lighting import set_lighting
from sarsim.pioneer3at import Pioneer3AT
from sarsim.rendering import Renderer
from sarsim.scoring.true_surface import true_surface
from sarsim.victims import victims_of

ATTEMPTS = 10
"""Random arenas that are drawn for a scene before it is given up."""


def render_scene(
    recipe: Recipe, index: int, path: Path, on_frame: Callable[[], object] = lambda: None
) -> tuple[SceneRecipe, NDArray[np.int64]]:
    """Write scene ``index`` of a dataset to a file; the bytes depend on the recipe and the index alone.

    Args:
        recipe: of the dataset.
        index: of the scene.
        path: of the file.
        on_frame: called after every frame.

    Returns:
        What the scene is made of, and (8,) depth returns by label.

    Raises:
        InputError: the arena cannot be had, or the robot cannot drive in it.
    """
    scene, arena = find_scene(recipe, index)
    with World(arena, scene, recipe.width, recipe.height) as world:
        stations = world.drive(recipe, recipe.rng(index, "drive")).stations(recipe.frames)
        noise = recipe.rng(index, "noise")
        with SceneWriter(path, recipe.frames, world.content()) as writer:
            for i, station in enumerate(stations):
                writer.write(i, world.look(station, noise))
                on_frame()
    return scene, writer.label_points


def find_scene(recipe: Recipe, index: int) -> tuple[SceneRecipe, RescueArena]:
    """What scene ``index`` is made of, and its arena: the first one drawn whose parts fit into its tiles.

    Raises:
        InputError: the arena cannot be had.
    """
    *tried, last = recipe.scenes(index, ATTEMPTS)
    for scene in tried:
        with suppress(InputError):
            return scene, load_arena(scene.arena, random=scene.random)
    return last, load_arena(last.arena, random=last.random)


class World:
    """An arena with a robot that is moved by hand, and what the robot's camera sees.

    Attributes:
        model: of arena and robot.
        data: of the model.
        camera: the robot's.
    """

    def __init__(self, arena: RescueArena, scene: SceneRecipe, width: int, height: int):
        """Images are ``width`` × ``height`` pixels."""
        self._scene = scene
        self._T_world_start = arena.T_world_start
        self._mjcf = arena.mjcf_model.to_xml_string()
        self._robot = Pioneer3AT()
        arena.add_free_entity(self._robot)
        self._physics = mjcf.Physics.from_mjcf_model(arena.mjcf_model)
        set_lighting(self._physics, self._robot, scene.conditions.lighting)
        self.model: mujoco.MjModel = self._physics.model.ptr
        self.data: mujoco.MjData = self._physics.data.ptr
        self._renderer = Renderer(self.model, width, height)
        self.camera = RgbdCamera(self._renderer, self._robot.camera.full_identifier)
        self._move(self._T_world_start)
        self._victims = victims_of(self.model, self.data)
        self._victim_of_geom = np.full(self.model.ngeom, NO_BOX, np.int16)
        for number, victim in enumerate(self._victims):
            self._victim_of_geom[victim.geoms] = number

    def drive(self, recipe: Recipe, rng: np.random.Generator) -> Drive:
        """A drive from the arena's start."""
        body = self.camera.base_body
        surface = true_surface(self.model, self.data, body, self._T_world_start[:3, 3])
        footing = Footing(self.model, self.data, body, surface.grid)
        return Drive(surface, footing, self._T_world_start, recipe.drive, rng)

    def look(self, station: Station, rng: np.random.Generator) -> SceneFrame:
        """What the robot sees from a station; ``rng`` draws the errors of its sensors."""
        self._move(station.T_world_base)
        true = self.camera.look(self.data)
        seen = self._scene.conditions.sense(true, rng)
        boxes, areas = self._victims_in(true.instance)
        return SceneFrame(
            time=station.time,
            rgb=seen.rgb,
            depth=seen.depth,
            label=seen.label,
            instance=seen.instance,
            pose_true=station.T_world_base,
            pose_odom=station.T_odom_base,
            T_base_camera=seen.T_base_camera,
            victim_pixels=boxes,
            victim_area=areas,
        )

    def content(self) -> SceneContent:
        """What the scene's file says but for the frames."""
        model, victims = self.model, self._victims
        return SceneContent(
            settings=self._scene.as_json(),
            mjcf=self._mjcf,
            intrinsics=self.camera.intrinsics,
            geom_name=[model.geom(geom).name for geom in range(model.ngeom)],
            geom_label=geom_labels(model),
            geom_victim=self._victim_of_geom,
            victim_id=[victim.id for victim in victims],
            victim_pose=np.array([victim.T_world_victim for victim in victims]).reshape(-1, 4, 4),
            victim_box=np.array([victim.box for victim in victims]).reshape(-1, 2, 3),
        )

    def close(self) -> None:
        """Free the OpenGL context and the model."""
        self._renderer.close()
        self._physics.free()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _move(self, T_world_base: NDArray[np.float64]) -> None:
        """Put the robot down and find out where its camera and lamp are; nothing is simulated."""
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(T_world_base[:3, :3]).ravel())
        self._robot.set_pose(self._physics, T_world_base[:3, 3], quat)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def _victims_in(self, instance: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """(V, 4) boxes of the pixels that show each victim, ``NO_BOX`` where none does, and (V,) their number."""
        boxes = np.full((len(self._victims), 4), NO_BOX, np.int32)
        areas = np.zeros(len(self._victims), np.int32)
        image_kernels.victim_boxes(instance, self._victim_of_geom, boxes, areas)
        return boxes, areas
