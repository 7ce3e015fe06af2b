"""Arenas in other colours."""

from itertools import combinations

import mujoco
import numpy as np

from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.random_arena import RandomArenaConfig, build_random
from sarsim.arenas.random_draws import RandomDraws
from sarsim.arenas.random_paint import paint


def model_of(seed: int, *, painted: bool) -> mujoco.MjModel:
    config = RandomArenaConfig(columns=4, rows=4, victims=1, difficulty=2, painted=painted)
    return mujoco.MjModel.from_xml_string(build_random(seed, config).to_xml())


def look_of(model: mujoco.MjModel) -> np.ndarray:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, 120, 160) as renderer:
        renderer.update_scene(data, "top")
        return renderer.render().copy()


def test_paint_changes_nothing_but_the_look():
    plain, painted = model_of(5, painted=False), model_of(5, painted=True)
    for array in ("geom_pos", "geom_quat", "geom_size", "geom_user", "geom_type"):
        assert np.array_equal(getattr(plain, array), getattr(painted, array))
    assert np.abs(look_of(plain).astype(int) - look_of(painted)).mean() > 10


def test_the_same_seed_gives_the_same_paint():
    config = RandomArenaConfig(columns=4, rows=4, victims=1, painted=True)
    assert build_random(6, config).to_xml() == build_random(6, config).to_xml()


def test_seeds_look_different():
    colours = [look_of(model_of(seed, painted=True)).reshape(-1, 3) for seed in (1, 2, 4)]
    commonest = [np.unique(c, axis=0, return_counts=True) for c in colours]
    floors = [values[counts.argsort()[-2:]].astype(int) for values, counts in commonest]  # one is the sky
    assert all(np.abs(a - b).max() > 20 for a, b in combinations(floors, 2))


def test_whatever_is_drawn_mujoco_reads():
    for seed in range(12):
        builder = ArenaBuilder("room")
        for kind in ("tall_wall", "deck_17", "ramp_17"):
            builder.add_element(kind, (0, 0, 0), 0)
        builder.add_floor((-1, -1), (1, 1))
        paint(builder, RandomDraws(np.random.default_rng(seed)))
        model = mujoco.MjModel.from_xml_string(builder.to_xml())
        assert ((model.mat_rgba >= 0) & (model.mat_rgba <= 1)).all()
