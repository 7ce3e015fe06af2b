import mujoco
import numpy as np
from numpy.testing import assert_allclose

from sarsim.arenas.things.thing import data_of, things_of
from sarsim.arenas.things.warmth import AMBIENT_TEMPERATURE, CLOTHES_TEMPERATURE, SKIN_TEMPERATURE, temperatures

ARENA = """<mujoco><size nuser_geom="1"/>
<asset><material name="victim_1_top"/><material name="victim_1_skin"/></asset>
<worldbody><geom type="plane" size="1 1 1" user="2"/>
<body name="victim_1"><geom size="1" material="victim_1_skin" user="6"/>
<geom size="1" material="victim_1_top" user="6"/></body>
<body name="victim_2"><geom size="1" user="6"/></body><body name="victim_3"><geom size="1" user="6"/></body>
</worldbody><custom><text name="victim_3" data="{}"/></custom></mujoco>"""


def test_the_living_are_warm_through_their_clothes_and_all_else_is_cold():
    model = mujoco.MjModel.from_xml_string(ARENA.format(data_of("victim", state="dead")))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    warm = temperatures(model, things_of(model, data))
    assert warm.dtype == np.float32
    assert_allclose(
        warm,
        [
            AMBIENT_TEMPERATURE,
            SKIN_TEMPERATURE,
            CLOTHES_TEMPERATURE,
            SKIN_TEMPERATURE,
            AMBIENT_TEMPERATURE,
            AMBIENT_TEMPERATURE,
        ],
    )
