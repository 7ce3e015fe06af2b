"""Furniture of all sizes in random arenas: it is clutter on its own tile, fails no check, and must be asked for."""

from dataclasses import replace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from pipeline.labels import Label
from sarsim.arenas.checks import failed_checks
from sarsim.arenas.layout import BLOCKED, Layout
from sarsim.arenas.random_arena import RandomArenaConfig, build_random
from sarsim.arenas.random_draws import RandomDraws
from sarsim.arenas.random_rooms import BACK_Y, FURNITURE, furnish
from sarsim.dataset.settings import ArenaRange
from sarsim.sensors.camera import geom_labels

ROOM = RandomArenaConfig(columns=6, rows=5, wall_density=0.1, ramps=0.1, clutter=0, victims=0, furnished=0.4)


def draws(seed):
    return RandomDraws(np.random.default_rng(seed))


@pytest.mark.parametrize(
    "kind", sorted(set(FURNITURE), key=lambda kind: kind.__name__), ids=lambda kind: kind.__name__
)
def test_a_piece_stays_on_its_tile_and_is_no_deck(kind) -> None:
    for seed in range(200):
        boxes = np.array(kind(draws(seed)))
        low, high = boxes[:, ::2], boxes[:, 1::2]
        assert (low < high).all()
        assert np.abs(boxes[:, :2]).max() <= 60
        assert -60 <= boxes[:, 2].min() < boxes[:, 3].max() <= BACK_Y
        assert 0 <= boxes[:, 4].min() < boxes[:, 5].max() <= 215
        # The highest deck is 34 cm high: a level top that no step leads to is higher.
        assert boxes[:, 5].max() > 37


def test_furniture_has_a_share_of_the_tiles_in_rows_of_a_kind() -> None:
    layout = Layout(8, 8)
    pieces = furnish(layout, draws(0), 0.25)
    assert len({piece.tile for piece in pieces}) == len(pieces) == 16
    assert all(layout.ground(piece.tile) == BLOCKED for piece in pieces)
    assert len({piece.boxes for piece in pieces}) < len(pieces)


@pytest.mark.parametrize("seed", [2, 3])
def test_a_furnished_arena_is_checked_clutter_and_painted(seed: int) -> None:
    xml = build_random(seed, ROOM).to_xml()
    assert list(failed_checks(xml)) == []
    model = mujoco.MjModel.from_xml_string(xml)
    ours = [g for g in range(model.ngeom) if model.geom(g).name.startswith("furniture_")]
    assert len(ours) > 10
    assert set(geom_labels(model)[ours]) == {Label.CLUTTER}
    assert len(np.unique(model.geom_rgba[ours], axis=0)) > 3
    assert build_random(seed, ROOM).to_xml() == xml


def test_without_the_setting_nothing_changes() -> None:
    plain = replace(ROOM, furnished=0.0)
    assert "furniture_" not in build_random(2, plain).to_xml()
    names = [g.get("name") for g in ElementTree.fromstring(build_random(2, ROOM).to_xml()).iterfind("worldbody/geom")]
    assert any(name.startswith("furniture_") for name in names)
    before = ArenaRange().draw(np.random.default_rng(7))
    assert ArenaRange(furnished=(0.1, 0.4)).draw(np.random.default_rng(7)).columns == before.columns
    assert before.furnished == 0
