"""The robot at rest on ground of known shape, and on the NIST arena's ridge against the physics."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.grid_map import Grid
from pipeline.robot import Velocity
from pipeline.transforms import from_rotation, roll_pitch_of, yaw_of
from sarsim.arenas.load import load_arena
from sarsim.assets import asset
from sarsim.dataset import drive
from sarsim.dataset.drive import WheelContact
from sarsim.ground_truth.columns import convex_bodies
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

GRID = Grid(np.array([-60, -60]), 0.05, (120, 120))
FLOOR = "<geom type='plane' size='2 2 .1'/>"
SINK = 0.001  # m, of the tyres


def contact_on(geoms: str) -> WheelContact:
    """The ground that some geoms make."""
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return WheelContact(convex_bodies(model, data, None), GRID)


def slope(climb: float, rise: float) -> str:
    """A large board through the origin, so steep along x and y."""
    normal = np.array([-climb, -rise, 1.0]) / np.linalg.norm([climb, rise, 1.0])
    place, up = (" ".join(f"{n:.9f}" for n in vector) for vector in (-0.5 * normal, normal))
    return f"<geom type='box' size='2 2 .5' pos='{place}' zaxis='{up}'/>"


def test_the_numbers_are_those_of_the_model() -> None:
    model = mujoco.MjModel.from_xml_path(str(asset("robots", "pioneer3at", "pioneer3at.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    wheels = [f"{end}_{side}_wheel" for end in ("front", "rear") for side in ("left", "right")]
    np.testing.assert_allclose(drive.WHEEL_CENTRES, [data.body(name).xpos for name in wheels], atol=1e-9)
    np.testing.assert_allclose(drive.CENTRE_OF_MASS, data.subtree_com[0], atol=1e-3)
    assert model.geom("front_left_tyre").size[0] - SINK == pytest.approx(drive.LOADED_RADIUS)


def test_on_the_floor_it_stands_level() -> None:
    T = contact_on(FLOOR).rest_pose(0.3, -0.2, 0.7, 0.0)
    assert T is not None
    np.testing.assert_allclose(T[:3, 3], [0.3, -0.2, -SINK], atol=1e-6)
    assert yaw_of(T) == pytest.approx(0.7)
    np.testing.assert_allclose(roll_pitch_of(T), 0, atol=1e-6)


@given(climb=st.floats(-0.35, 0.35), rise=st.floats(-0.25, 0.25), yaw=st.floats(-3.1, 3.1))
def test_on_a_slope_it_leans_as_the_slope_does(climb: float, rise: float, yaw: float) -> None:
    T = contact_on(slope(climb, rise)).rest_pose(0.0, 0.0, yaw, 0.0)
    assert T is not None
    normal = np.array([-climb, -rise, 1.0]) / np.linalg.norm([climb, rise, 1.0])
    # A wheel as thin as a disc touches a slope across its direction a little beside its lowest point.
    assert np.degrees(np.arccos(np.clip(T[:3, 2] @ normal, -1, 1))) < 0.5
    assert abs(T[:3, 3] @ normal) < 0.01  # 8.8 mm at the steepest, climb -0.31 and rise 0.25
    assert yaw_of(T) == pytest.approx(yaw, abs=1e-6)


def test_with_one_wheel_on_a_block_the_opposite_one_carries_and_a_third() -> None:
    block = "<geom type='box' size='.06 .06 .02' pos='.135 .199 .02'/>"
    T = contact_on(FLOOR + block).rest_pose(0.0, 0.0, 0.0, 0.0)
    assert T is not None
    bottoms = (from_rotation(T[:3, :3], T[:3, 3]) @ np.column_stack([drive.WHEEL_CENTRES, np.ones(4)]).T)[2]
    above = bottoms - drive.LOADED_RADIUS - [0.04, 0, 0, 0]
    on_ground = np.abs(above) < 1e-3
    # The centre of mass is in front of the diagonal's middle: front right carries, and rear left hangs.
    np.testing.assert_array_equal(on_ground, [True, True, False, True])
    assert above[2] == pytest.approx(0.04, abs=2e-3)


def test_it_cannot_stand_where_a_wheel_is_over_nothing_or_the_chassis_on_the_ground() -> None:
    assert contact_on(FLOOR).rest_pose(2.0, 0.0, 0.0, 0.0) is None
    keel = "<geom type='box' size='.1 .03 .06' pos='0 0 .06'/>"
    assert contact_on(FLOOR + keel).rest_pose(0.0, 0.0, 0.0, 0.0) is None
    assert contact_on(FLOOR + keel).rest_pose(1.0, 0.0, 0.0, 0.0) is not None


def test_what_is_overhead_is_no_ground() -> None:
    ceiling = "<geom type='box' size='2 2 .05' pos='0 0 .75'/>"
    T = contact_on(FLOOR + ceiling).rest_pose(0.0, 0.0, 0.0, 0.0)
    assert T is not None and T[2, 3] == pytest.approx(-SINK)


def test_over_the_ridge_it_leans_as_the_driven_robot_does() -> None:
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(), seed=0)
    try:
        model, data = robot.physics.model.ptr, robot.physics.data.ptr
        ground = WheelContact(convex_bodies(model, data, robot.base_body), GRID)
        robot.robot.set_pose(robot.physics, (-1.2, -1.39, 0), (1, 0, 0, 0))
        heights, angles, steepest = [], [], 0.0
        while (T := robot.trajectory[-1].T_world_base)[0, 3] < 1.1 or len(heights) < 50:
            robot.drive(Velocity(0.2))
            if len(robot.trajectory) > 30:  # once it has been set down
                at_rest = ground.rest_pose(T[0, 3], T[1, 3], yaw_of(T), T[2, 3])
                assert at_rest is not None
                heights.append(at_rest[2, 3] - T[2, 3])
                angles.append(np.subtract(roll_pitch_of(at_rest), roll_pitch_of(T)))
                steepest = max(steepest, abs(roll_pitch_of(T)[1]))
    finally:
        robot.close()
    assert np.degrees(steepest) > 15
    assert np.abs(heights).max() < 0.002
    assert np.degrees(np.abs(angles).max()) < 0.5
