"""A wall, a floor and a ramp, whose true faces are known."""

import mujoco

from sarsim.ground_truth.faces import Face, true_faces

SCENE = """
<mujoco>
  <size nuser_geom="1"/>
  <asset>
    <mesh name="ramp" vertex="0 -0.6 0  0 0.6 0  0.59 -0.6 0  0.59 0.6 0  0.59 -0.6 0.17  0.59 0.6 0.17"/>
  </asset>
  <worldbody>
    <geom type="plane" size="3 2 0.1" user="2"/>
    <geom type="box" pos="1 0 0.5" size="0.02 1 0.5" user="1"/>
    <geom type="mesh" mesh="ramp" pos="-1 0 0" user="3"/>
    <geom type="box" pos="-2 1 0.1" size="0.1 0.1 0.1" user="7"/>
    <geom type="sphere" pos="0 1 1" size="0.1" user="1"/>
  </worldbody>
</mujoco>
"""


def faces_of_scene() -> list[Face]:
    """The true faces of the scene."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return true_faces(model, data)
