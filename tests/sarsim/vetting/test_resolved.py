"""Every setting of an MJCF file holds for that file alone, whatever it is joined with."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.spatial import cKDTree

from sarsim.arenas.load import load_arena
from sarsim.commands.export_arena import ExportArenaConfig, export_arena
from sarsim.environment import RescueEnvironment
from sarsim.robots.names import robot_file

ALIKE = 1e-6  # m, kg, kg m² and elements of rotations
SETTINGS = [
    '<compiler angle="radian"/>',
    '<compiler angle="degree"/>',
    '<compiler eulerseq="ZYX"/>',
    '<compiler inertiafromgeom="true"/>',
    '<compiler inertiafromgeom="true" inertiagrouprange="0 4"/>',
    '<compiler settotalmass="5"/>',
    '<compiler boundmass="3" boundinertia="0.2"/>',
    '<compiler balanceinertia="true"/>',
    '<compiler discardvisual="true"/>',
    '<compiler fusestatic="true" alignfree="true"/>',
    '<default><geom density="5" margin="0.01" friction="0.2"/><joint damping="3" armature="1"/></default>',
    '<option gravity="0 0 -1.6" timestep="0.004" density="1.2"><flag contact="disable"/></option>',
    '<size nuser_geom="3" nuser_body="1"/><size njmax="500"/>',
    '<statistic extent="7"/><visual><map zfar="33"/></visual>',
]
ARENA = """<mujoco model="arena">{}<worldbody><light pos="0 0 4"/>
<geom name="floor" type="plane" size="4 4 .1" user="2"/><site name="start" pos="-1 0 0" euler="0 0 1.5"/>
<geom name="wall" type="box" size="2 .05 .6" pos="2 0 .6" euler="0 0 1.5" user="1"/>
<geom name="ramp" type="box" size=".6 .6 .01" pos="0 2 .2" euler="0.3 -.2 0.1" user="3"/>
<body name="door" pos="2 2 0" euler="0 0 1"><joint type="hinge" range="0 1" damping="1"/>
<geom name="leaf" type="box" size=".4 .03 1" pos=".4 0 1"/></body>
<body name="box" pos="-2 2 1"><freejoint/><inertial pos="0 0 .1" mass="4"
diaginertia=".3 .2 .2"/><geom type="box" size=".2 .2 .2"/></body></worldbody></mujoco>"""
TURNED = '<site name="imu" euler="1 2 3"'

pytestmark = pytest.mark.usefixtures("unisolated")


@pytest.fixture
def joined():
    environments = []

    def join(arena: Path, robot: Path) -> RescueEnvironment:
        environments.append(RescueEnvironment(load_arena(str(arena)), str(robot)))
        return environments[-1]

    yield join
    for environment in environments:
        environment.close()


def arena_of(folder: Path, setting: str = "") -> Path:
    (folder / "arena.xml").write_text(ARENA.format(setting))
    return folder / "arena.xml"


def robot_of(folder: Path, setting: str = "") -> Path:
    text = robot_file("jackal").read_text().replace("<custom>", f"{setting}<custom>", 1)
    (folder / "robot.xml").write_text(text.replace('<site name="imu"', TURNED))
    return folder / "robot.xml"


def alone(path: Path) -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.fusestatic = False  # only so that all bodies have their names here
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def alone_of(arena) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(arena.to_xml(), arena.mjcf_model.get_assets())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def bodies(model: mujoco.MjModel, data: mujoco.MjData, root: int, frame: int) -> list[np.ndarray]:
    """Of each body of a tree, in the frame of a body: mass, inertias, the pose of those, and joints."""
    R, origin = data.xmat[frame].reshape(3, 3), data.xpos[frame]
    described = []
    for body in np.flatnonzero(model.body_rootid == model.body_rootid[root]):
        turn = R.T @ data.ximat[body].reshape(3, 3)
        inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
        hinges = model.jnt_type != mujoco.mjtJoint.mjJNT_FREE
        joints = np.flatnonzero((model.jnt_bodyid == body) & hinges)
        numbers = [model.jnt_range[joints], model.jnt_axis[joints], model.dof_damping[model.jnt_dofadr[joints]]]
        place = (data.xipos[body] - origin) @ R
        described.append(np.concatenate([np.ravel(x) for x in (model.body_mass[body], inertia, place, *numbers)]))
    return [row for row in described if row[0] > 0]


def geoms(model: mujoco.MjModel, data: mujoco.MjData, root: int, frame: int) -> np.ndarray:
    """(N, 12 + 3 + 1) sorted: pose in the frame of a body, size and first ``user`` of each geom of a tree."""
    R, origin = data.xmat[frame].reshape(3, 3), data.xpos[frame]
    chosen = np.flatnonzero(model.body_rootid[model.geom_bodyid] == model.body_rootid[root])
    turns = np.einsum("ji,njk->nik", R, data.geom_xmat[chosen].reshape(-1, 3, 3)).reshape(-1, 9)
    rows = [(data.geom_xpos[chosen] - origin) @ R, turns, model.geom_size[chosen], model.geom_user[chosen, :1]]
    rows = np.concatenate(rows, axis=1)
    return rows[np.lexsort(rows.round(4).T)]


def check_alike(one, other):
    assert len(bodies(*one)) == len(bodies(*other)) > 0
    for a, b in zip(bodies(*one), bodies(*other), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=ALIKE)
    np.testing.assert_allclose(geoms(*one), geoms(*other), rtol=0, atol=ALIKE)


def check_joined(environment: RescueEnvironment, arena: Path, robot: Path) -> None:
    """Arena and robot are as each is alone, also by names of what the robot's software asks for."""
    physics, parts = environment.physics, environment.robot
    model, data = physics.model.ptr, physics.data.ptr
    mujoco.mj_forward(model, data)
    one, two = alone(robot), alone(arena)
    base = physics.bind(parts.base).element_id
    link = one[0].body("base_link").id
    check_alike((*one, link, link), (model, data, base, base))
    R, Q = (m.T @ n for m, n in (
        (one[1].body("base_link").xmat.reshape(3, 3), one[1].cam("camera").xmat.reshape(3, 3)),
        (data.xmat[base].reshape(3, 3), physics.bind(parts.camera).xmat.reshape(3, 3)),
    ))  # fmt: skip
    np.testing.assert_allclose(R, Q, atol=ALIKE)
    for name in ("floor", "wall", "ramp"):
        still, here = two[1].geom(name), data.geom(name)
        np.testing.assert_allclose([*still.xpos, *still.xmat], [*here.xpos, *here.xmat], atol=ALIKE)
    for name in ("door", "box"):
        check_alike((*two, two[0].body(name).id, 0), (model, data, model.body(name).id, 0))


@pytest.mark.parametrize(("setting", "robots"), zip(SETTINGS, SETTINGS[5:] + SETTINGS[:5], strict=True))
def test_a_setting_of_either_file_does_not_reach_the_other(setting, robots, tmp_path, joined):
    arena = arena_of(tmp_path, setting)
    for robots_own in (robots, setting):
        check_joined(joined(arena, robot_of(tmp_path, robots_own)), arena, tmp_path / "robot.xml")


SCENES = {
    "replicate": '<replicate count="4" offset=".8 0 0" euler="0 0 20">'
    '<geom type="cylinder" size=".1 .4" pos="-1 2 .4"/></replicate>',
    "frames": '<frame pos="1 1 0" euler="0 0 45"><geom name="f" type="box" size=".3 .05 .4"/>'
    '<site name="s" pos="1 0 0"/>'
    '<camera pos="0 1 1" euler="40 0 0"/><light pos="0 0 3" dir="1 0 -1"/><frame quat="0 0 0 1">'
    '<body pos="1 0 .4" euler="0 90 0"><frame euler="90 0 0"><joint axis="1 0 0" pos="0 0 .1"/>'
    '<geom type="capsule" fromto="0 0 0 1 1 1" size=".05"/></frame></body>'
    "</frame></frame>",
    "frame first": '<body pos="1 1 1"><frame pos="0 0 1"><geom size=".1"/><body><geom size=".3"/></body></frame>'
    '<geom size=".2"/><body pos="1 0 0"><geom size=".4"/></body></body>'
    '<frame><body pos="0 3 0"><geom size=".5"/></body></frame>',
    "frame's class": '<frame childclass="red" pos="0 0 1"><geom size=".2"/><body childclass="blue"><geom size=".1"/>'
    '<geom class="red"/></body></frame>',
    "scaled frame": '<frame scale="2" pos="1 1 1"><geom size=".1" pos=".5 0 0"/></frame>',
    "attached": '<frame pos="1 1 0"><attach model="m" body="post" prefix="a/"/></frame>'
    '<attach model="n" body="post" prefix="b/"/>',
    "included": '<include file="parts/walls.xml"/>',
    "meshes": '<geom type="mesh" mesh="panel" euler="0 0 30" pos="1 0 0"/><geom type="box" mesh="panel" pos="0 1 0"/>'
    '<geom type="hfield" hfield="hills"/>',
}
HEAD = """<compiler angle="degree" meshdir="stl" texturedir="png"/>
<asset><mesh name="panel" file="panel.stl" scale="1 2 1"/>
<model name="m" file="parts/m/post.xml"/><model name="n" file="parts/n/post.xml"/><texture type="2d" file="t.png"/>
<material name="paint" texture="t"/><texture name="sky" type="cube" fileright="t.png" fileleft="t.png"/>
<hfield name="hills" file="hills.png" size="2 2 1 .1"/></asset><default>
<default class="red"><geom type="box" size=".1 .2 .3" euler="0 0 20" material="paint"/></default>
<default class="blue"><geom type="capsule" size=".1 .2"/></default></default>"""


def files_around(folder):
    """The files to which ``SCENES`` refer: two models in folders of their own, each with a mesh of the same name."""
    (folder / "parts").mkdir()
    walls, more = folder / "parts" / "walls.xml", folder / "parts" / "more.xml"
    walls.write_text('<walls><include file="parts/more.xml"/><geom size=".3" pos="1 0 0"/></walls>')
    more.write_text('<mujocoinclude><geom size=".2" euler="0 0 45" pos="0 2 0"/></mujocoinclude>')
    for name, height in (("m", 1.0), ("n", 2.0)):
        place = folder / "parts" / name
        (place / "stl").mkdir(parents=True)
        trimesh.creation.box((0.2, 0.3, height)).export(place / "stl" / "post.stl")
        (place / "post.xml").write_text(
            '<mujoco><compiler meshdir="stl" angle="radian" eulerseq="ZYX"/><asset><mesh file="post.stl"/></asset>'
            '<default><geom pos="0 0 1"/><default class="post"><geom type="mesh" mesh="post"/></default></default>'
            '<worldbody><body name="post" euler=".1 .2 .3"><geom class="post"/></body></worldbody></mujoco>'
        )
    for kind in ("stl", "png"):
        (folder / kind).mkdir()
    trimesh.creation.icosphere(radius=0.4).export(folder / "stl" / "panel.stl")
    Image.fromarray(np.arange(48, dtype=np.uint8).reshape(4, 4, 3)).save(folder / "png" / "t.png")
    Image.fromarray(np.arange(16, dtype=np.uint8).reshape(4, 4)).save(folder / "stl" / "hills.png")


@pytest.mark.parametrize("scene", SCENES)
def test_what_mujoco_reads_is_an_arena_as_mujoco_has_it(scene, tmp_path, joined):
    files_around(tmp_path)
    text = ARENA.format(HEAD).replace("</worldbody>", f"{SCENES[scene]}</worldbody>")
    (tmp_path / "arena.xml").write_text(text)
    robot = robot_of(tmp_path, '<compiler angle="radian" eulerseq="ZYX"/>')
    environment = joined(tmp_path / "arena.xml", robot)
    (tmp_path / "again").mkdir()
    export_arena(ExportArenaConfig(str(tmp_path / "arena.xml"), tmp_path / "again" / "arena.xml"))
    check_scene(alone(tmp_path / "arena.xml"), alone(tmp_path / "again" / "arena.xml"))
    check_scene(alone(tmp_path / "arena.xml"), alone_of(load_arena(str(tmp_path / "again" / "arena.xml"))))
    model, data = environment.physics.model.ptr, environment.physics.data.ptr
    mujoco.mj_forward(model, data)
    base = environment.physics.bind(environment.robot.base).element_id
    check_scene(alone(tmp_path / "arena.xml"), (model, data), base)


def check_scene(one, other, base=None):
    """What stands in one model stands in another one, in the same places; there the body ``base`` is a robot's."""
    (model, data), (wanted, places) = other, one
    robot = model.nbody if base is None else model.body_rootid[base]
    chosen = np.flatnonzero(model.body_rootid[model.geom_bodyid] < robot)
    assert len(chosen) == wanted.ngeom
    assert model.ntex >= wanted.ntex
    rows, others = (
        np.column_stack([d.geom_xpos, d.geom_xmat, m.geom_size, m.geom_rbound])[some]
        for m, d, some in ((wanted, places, np.arange(wanted.ngeom)), (model, data, chosen))
    )
    distance, nearest = cKDTree(others).query(rows)
    assert distance.max() < ALIKE
    assert len(set(nearest)) == len({tuple(row) for row in rows.round(4)})
    np.testing.assert_allclose(data.cam_xmat[: wanted.ncam], places.cam_xmat, atol=ALIKE)
    np.testing.assert_allclose(data.light_xdir[: wanted.nlight], places.light_xdir, atol=ALIKE)


def test_mujoco_has_no_public_setter_of_the_precision_of_its_xml():
    """Where it has one, vetting is to use it instead of the library's private one."""
    writers = [str(getattr(mujoco.MjSpec, name).__doc__) for name in ("to_file", "to_xml")]
    assert not [name for name in (*dir(mujoco), *dir(mujoco.MjSpec), *writers) if "precision" in name.lower()]
