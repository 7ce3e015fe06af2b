"""Scores of the files that sarsim or another program submitted for an arena."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.arrays import MaskLayer, Place, Places, Pose, Values
from pipeline.errors import InputError
from pipeline.plugins.league.brief import MissionBrief
from pipeline.plugins.league.cloud import NORMAL, RGB, CloudFile, read_cloud
from pipeline.plugins.league.codes import CODES_ENDING, ReadCode, read_codes
from pipeline.plugins.league.hand_in import league_frame
from pipeline.plugins.league.pois import TYPE_OF, PointOfInterest, name_of, read_pois
from pipeline.plugins.league.validation import handed_in_files
from pipeline.robot import RobotModel
from pipeline.transforms import transform_points
from sarsim.arenas.things.thing import things_of, things_of_kind
from sarsim.ground_truth.meshes import true_scene
from sarsim.ground_truth.true_surface import GroundTruthSurface, Survey, clearance_of
from sarsim.plugins.league.fiducial_tubes import Tubes, is_well_placed, mapped_tubes, nearest_code, tubes_of
from sarsim.plugins.league.leagues import LeagueRun, SmallRun, VirtualRun, league_score, small_score, virtual_score
from sarsim.plugins.league.portals import portals
from sarsim.scoring.coverage import SEEN_HEIGHT
from sarsim.scoring.coverage_kernels import see
from sarsim.scoring.victims import MAX_MATCH_DISTANCE, min_cost_pairs

COVERAGE_RADIUS = 0.1
"""m, a voxel of a coarse map; the 3D map also covers cells within this distance of the cells that it shows."""
MAX_CORRESPONDENCE_DISTANCE = 0.5  # m; the registration ignores points farther than this from every true surface
MAX_POINTS = 20_000  # Larger clouds are thinned to about this size; the mean distance is accurate to 1%
MAX_ICP_ITERATIONS = 30  # Maximum iterations of the registration, which converges in fewer


@dataclass(frozen=True, eq=False)
class TrueFind:
    """An object in the arena that scores as a find.

    Attributes:
        type: one of the league's types.
        name: the name that a find must have.
        position: (3,) m in ``world``.
        is_victim, is_living: whether the object is a victim, and whether it is alive.
    """

    type: str
    name: str
    position: Place
    is_victim: bool = False
    is_living: bool = False


def true_finds(model: mujoco.MjModel, data: mujoco.MjData) -> list[TrueFind]:
    """The objects in an arena of the kinds that the league lists; living victims are listed as heat sources too."""
    things = things_of(model, data)
    return [
        TrueFind(TYPE_OF[kind], name_of(kind, thing.text), thing.centre, kind == "victim", thing.is_warm)
        for kind in TYPE_OF
        for thing in things_of_kind(things, kind)
    ]


@dataclass(frozen=True, eq=False)
class TrueArena:
    """The facts about the arena that a judge knows.

    Attributes:
        surface: the true ground.
        finds: the objects that score as finds.
        scene: Open3D's RaycastingScene of all visible surfaces.
        T_world_league: 4×4 pose of the league's frame.
        portals: (N, 2) m in ``world``, doorways and junctions.
        tubes: the small league's fiducials and codes.
    """

    surface: GroundTruthSurface
    finds: list[TrueFind]
    scene: Any
    T_world_league: Pose
    portals: Places
    tubes: Tubes


def true_arena(
    model: mujoco.MjModel, data: mujoco.MjData, T_world_start: Pose, robot: RobotModel, robot_body: int | None = None
) -> TrueArena:
    """Survey an arena for a robot that starts at a 4×4 pose; InputError if it cannot stand there.

    ``robot_body``: id of the robot's root body, which is left out; None if the model has no robot.
    """
    surface = Survey(model, data, robot_body, robot).surface_from(T_world_start[:3, 3])
    return TrueArena(
        surface,
        true_finds(model, data),
        true_scene(model, data, robot_body),
        league_frame(T_world_start, robot.half_length),
        portals(surface, clearance_of(robot)),
        tubes_of(model, data),
    )


def registered_error(points: NDArray[np.floating], scene: Any) -> float:
    """Mean distance, m, of points (N, 3) in the world from the true surfaces, after a registration.

    Assumed: the league's global error is this distance. The registration is point-to-plane ICP (Chen and Medioni
    1992) from the identity, with exact nearest points on the true surfaces. The distance is infinite without points.
    """
    if not len(points):
        return float("inf")
    moved = np.asarray(points, np.float64)[:: max(1, len(points) // MAX_POINTS)]
    for _ in range(MAX_ICP_ITERATIONS):
        step = _icp_step(moved, *_nearest(moved, scene))
        moved = Rotation.from_rotvec(step[:3]).apply(moved) + step[3:]
        if np.abs(step).max() < 1e-6:
            break
    nearest, _ = _nearest(moved, scene)
    return float(np.linalg.norm(moved - nearest, axis=1).mean())


def _nearest(points: NDArray[np.float64], scene: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 3) points of the surfaces nearest to points (N, 3), m in ``world``, and the normals (N, 3) there."""
    found = scene.compute_closest_points(np.ascontiguousarray(points, np.float32))
    return tuple(found[name].numpy().astype(np.float64) for name in ("points", "primitive_normals"))


def _icp_step(
    points: NDArray[np.float64], nearest: NDArray[np.float64], normals: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(6,) rotation vector, rad, and translation, m, that move points (N, 3) towards their tangent planes."""
    # A degenerate triangle, as in the centre of a cylinder's cap, has no normal.
    near = (np.linalg.norm(points - nearest, axis=1) < MAX_CORRESPONDENCE_DISTANCE) & np.isfinite(normals).all(axis=1)
    points, nearest, normals = points[near], nearest[near], normals[near]
    rows = np.hstack([np.cross(points, normals), normals])
    step, *_ = np.linalg.lstsq(rows.T @ rows, rows.T @ ((nearest - points) * normals).sum(axis=1), rcond=1e-9)
    return np.asarray(step)


def covered_cells(points: NDArray[np.floating], surface: GroundTruthSurface) -> MaskLayer:
    """(nx, ny) bool, the cells of the true ground that points (N, 3), m in ``world``, cover."""
    seen = np.zeros(surface.grid.shape, np.bool_)
    see(np.asarray(points, np.float64), surface.grid.origin, surface.grid.cell, surface.height, SEEN_HEIGHT, seen)
    return np.asarray(surface.grid.distance_to(seen) <= COVERAGE_RADIUS)


def matched_distances(places: NDArray[np.float64], things: NDArray[np.float64], within: float) -> Values:
    """Distances, m, from places (N, 3) to things (M, 3) of the same name, matched one to one ``within`` m."""
    distance = np.linalg.norm(places[:, None] - things[None], axis=2)
    return np.array([distance[i, k] for i, k in min_cost_pairs(np.where(distance <= within, distance, np.inf))])


def _places(items: Sequence[TrueFind] | Sequence[PointOfInterest]) -> NDArray[np.float64]:
    return np.array([item.position for item in items]).reshape(-1, 3)


def score_handed_in(
    folder: Path,
    arena: TrueArena,
    brief: MissionBrief,
    parked: Place | None = None,
    resets: int = 0,
    contacts: int = 0,
) -> dict[str, dict[str, dict[str, float]]]:
    """The scores of the first run in a folder: ``league``, ``virtual`` and, if the arena has tubes, ``small``.

    Args:
        folder: the folder of the files, or of an episode, which contains ``handed_in/``.
        arena: the arena that the robot was in.
        brief: the mission's brief, which defines rewards and penalties.
        parked: (2,) m, the robot's final position in the world; None if unknown.
        resets: number of times that the robot was touched.
        contacts: number of contacts with living victims.

    Raises:
        InputError: the 3D map or the list of finds is missing, or cannot be read.
    """
    files = handed_in_files(folder)
    for ending in (".ply", ".csv"):
        if not files[ending]:
            raise InputError(
                f"{folder}: contains no {ending} file; scoring needs a 3D map (.ply) and a list of finds (.csv)"
            )
    cloud, pois = read_cloud(files[".ply"][0]), read_pois(files[".csv"][0]).pois
    if not len(cloud.rows()):
        raise InputError(
            f"{files['.ply'][0]}: contains no readable points; to see why, run 'sarsim-validate-mission {folder}'"
        )
    points = transform_points(arena.T_world_league, cloud.rows())
    moved = transform_points(arena.T_world_league, _places(pois)).astype(np.float64)
    shown = covered_cells(points, arena.surface)
    run = league_run(cloud, points, shown, pois, moved, arena, resets)
    by_rules = virtual_run(shown, pois, moved, arena, parked, contacts, brief.rewards.beside)
    scores = {
        "league": league_score(run, brief.rewards, brief.penalties),
        "virtual": virtual_score(by_rules, brief.rewards, brief.penalties),
    }
    if len(arena.tubes.feet):
        named = files[".csv"][0].parent.glob(f"*{CODES_ENDING}")
        codes = [code for path in sorted(named)[:1] for code in read_codes(path)]
        scores["small"] = small_score(small_run(codes, points, arena, brief.rewards.near_fiducials), brief.rewards)
    return scores


def small_run(codes: Sequence[ReadCode], points: NDArray[np.floating], arena: TrueArena, within: float) -> SmallRun:
    """Measure the quantities that the small league scores, from the codes read and the map's points.

    ``points``: (N, 3) m in ``world``. A code is well placed if the map gives its distances from the two nearest
    fiducials with errors of at most ``within`` m.
    """
    shown, right = mapped_tubes(points, arena.tubes), {}
    for code in codes:
        place = transform_points(arena.T_world_league, code.position[None])[0].astype(np.float64)
        true = nearest_code(code.text, place, arena.tubes.codes)
        if true is not None and code.text not in right:
            right[code.text] = is_well_placed(place, true, shown, arena.tubes, within)
    return SmallRun(
        codes=len(arena.tubes.codes),
        read=len(right),
        placed=sum(right.values()),
        fiducials=len(shown),
        shown=int(np.isfinite(shown[:, 0]).sum()),
        is_autonomous=all(code.is_autonomous for code in codes),
    )


def league_run(
    cloud: CloudFile,
    points: NDArray[np.floating],
    shown: NDArray[np.bool_],
    pois: list[PointOfInterest],
    places: NDArray[np.float64],
    arena: TrueArena,
    resets: int,
) -> LeagueRun:
    """Measure the quantities that the Rescue Robot League scores.

    ``points``: (N, 3) m in ``world``, of the 3D map; ``places``: (M, 3) m in ``world``, of the finds.

    A find is right if it is matched, one to one, with an object of its type and name within ``MAX_MATCH_DISTANCE``. A
    run is autonomous unless a find's mode says otherwise.
    """
    names = {(find.type, find.name) for find in arena.finds}
    errors = [
        matched_distances(
            places[[(poi.type, poi.name) == name for poi in pois]],
            _places([find for find in arena.finds if (find.type, find.name) == name]),
            MAX_MATCH_DISTANCE,
        )
        for name in sorted(names)
    ]
    right = np.concatenate([np.zeros(0), *errors])
    extras = (RGB, NORMAL, ("confidence",))
    return LeagueRun(
        coverage=float(shown[arena.surface.drivable].mean()),
        global_error=registered_error(points, arena.scene),
        extras=sum(len(cloud.rows(names)) > 0 for names in extras),
        present=len(arena.finds),
        right=len(right),
        wrong=len(pois) - len(right),
        localisation_error=float(right.mean()) if len(right) else 0.0,
        is_autonomous=all(poi.mode == "A" for poi in pois),
        resets=resets,
    )


def virtual_run(
    shown: NDArray[np.bool_],
    pois: list[PointOfInterest],
    places: NDArray[np.float64],
    arena: TrueArena,
    parked: NDArray[np.float64] | None,
    contacts: int,
    reach: float,
) -> VirtualRun:
    """Measure the quantities that the Virtual Robot competition scores.

    A mark, or the robot ``parked`` at (2,) m, is near a victim within ``reach`` m of it; ``places``: (M, 3) m in
    ``world``, of the finds. Assumed: a find named victim or a heat source marks a victim; a heat source marks a
    living victim.
    A living victim scores if it is marked as living and the robot is parked near it.
    """
    victims = [find for find in arena.finds if find.is_victim]
    true, is_living = _places(victims)[:, :2], np.array([find.is_living for find in victims], np.bool_)
    is_heat = np.array([poi.type == "heat_sig" for poi in pois], np.bool_)
    is_mark = is_heat | np.array([poi.name == "victim" for poi in pois], np.bool_)
    near = np.linalg.norm(places[:, None, :2] - true, axis=2) <= reach
    called_alive = near[is_heat].any(axis=0) & is_living
    beside = np.zeros(len(true), np.bool_) if parked is None else np.linalg.norm(true - parked, axis=1) <= reach
    cells = arena.surface.grid.cell_of(arena.portals)
    return VirtualRun(
        portals=len(arena.portals),
        discovered=int(shown[cells[:, 0], cells[:, 1]].sum()),
        victims=len(victims),
        right=int(near[is_mark].any(axis=0).sum()),
        wrong=int((~near[is_mark].any(axis=1)).sum()),
        living=int(is_living.sum()),
        right_living=int((called_alive & beside).sum()),
        wrong_living=int((~near[is_heat][:, is_living].any(axis=1)).sum()),
        contacts=contacts,
    )
