"""What is drawn for a scene."""

from collections import Counter
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.dataset.manifest import split_of
from sarsim.dataset.recipe import Recipe, SceneRecipe
from sarsim.dataset.settings import ArenaRange, HarderDatasetConfig
from sarsim.sensors.lighting import Lighting


def first(recipe: Recipe, index: int) -> SceneRecipe:
    return next(recipe.candidates(index, 1))


def test_a_scene_is_drawn_from_seed_and_index_alone() -> None:
    recipe = Recipe(seed=5, frames=3)
    assert first(recipe, 4) == first(replace(recipe, frames=50, width=100), 4)
    assert first(recipe, 4) != first(recipe, 5)
    assert first(recipe, 4) != first(replace(recipe, seed=6), 4)


def test_random_arenas_are_within_their_ranges() -> None:
    wanted = ArenaRange(tiles=(5, 6), victims=(2, 2), difficulty=(1, 3), ramps=(0.3, 0.4), ceilings=1)
    drawn = [first(Recipe(random=wanted), index).random for index in range(30)]
    assert {config.columns for config in drawn if config} == {5, 6}
    assert {config.difficulty for config in drawn if config} == {1, 2, 3}
    assert all(c and c.victims == 2 and c.ceiling and 0.3 <= c.ramps <= 0.4 for c in drawn)


def test_a_share_of_the_arenas_is_painted() -> None:
    for share, least, most in ((0.0, 0, 0), (0.5, 5, 25), (1.0, 30, 30)):
        recipe = Recipe(random=ArenaRange(painted=share))
        drawn = [first(recipe, index).random for index in range(30)]
        assert least <= sum(config.painted for config in drawn if config) <= most


def test_furniture_is_drawn_last_and_only_where_it_is_wanted() -> None:
    bare, furnished = np.random.default_rng(0), np.random.default_rng(0)
    without = ArenaRange().draw(bare)
    with_some = ArenaRange(furniture=(0.1, 0.2), bulky=(0.3, 0.4), things=(5, 9)).draw(furnished)
    assert without.furniture == without.bulky == without.things == 0
    assert 5 <= with_some.things <= 9
    assert 0.1 <= with_some.furniture <= 0.2
    assert 0.3 <= with_some.bulky <= 0.4
    assert replace(with_some, furniture=0.0, bulky=0.0, things=0) == without
    bare.random(2)
    bare.integers(5, 9, endpoint=True)
    assert bare.random() == furnished.random()


def test_of_random_arenas_there_are_others_if_one_cannot_be_built() -> None:
    recipe = Recipe(arenas=("random", "nist_6x4"))
    assert len({scene.arena for scene in recipe.candidates(0, 5)}) == 5
    assert [scene.arena for scene in recipe.candidates(1, 5)] == ["nist_6x4"]
    assert list(islice(recipe.candidates(0, 5), 2)) == list(recipe.candidates(0, 2))


def test_arenas_are_taken_in_turn() -> None:
    recipe = Recipe(arenas=("nist_6x4", "a.raf", "b.xml"))
    assert [first(recipe, k).arena for k in range(4)] == ["nist_6x4", "a.raf", "b.xml", "nist_6x4"]


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 10, 11, 15])
def test_every_split_has_every_arena_equally_often(count: int) -> None:
    recipe = Recipe(arenas=tuple(f"{n}.raf" for n in range(count)))
    found = Counter((first(recipe, index).arena, split_of(index)) for index in range(10 * count))
    shares = {"train": 8, "val": 1, "test": 1}
    assert found == {(arena, split): shares[split] for arena in recipe.arenas for split in shares}


HARDER = Recipe(**vars(HarderDatasetConfig()))


def test_every_kind_of_light_air_and_sensor_is_drawn_in_the_harder_mix() -> None:
    drawn = [HARDER.conditions(index) for index in range(200)]
    assert {c.lighting for c in drawn} == set(Lighting)
    assert 30 < sum(c.air.dust > 0 for c in drawn) < 75
    assert 8 < sum(not c.depth_sensor.axial_noise for c in drawn) < 40
    assert len({c.depth_sensor.lateral_sigma for c in drawn}) > 50


def test_what_has_no_share_is_never_drawn() -> None:
    recipe = Recipe(lighting=(0, 0, 2), clear=1, ideal=1)
    drawn = [recipe.conditions(index) for index in range(20)]
    assert {c.lighting for c in drawn} == {Lighting.dark}
    assert all(c.air.dust == 0 and not c.depth_sensor.axial_noise for c in drawn)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Recipe(frames=0), "--frames 0: .*at least 1"),
        (lambda: Recipe(keyframes=(0.3, float("nan"))), "--keyframes 0.3 nan: .* between 0.01 and 10"),
        (lambda: Recipe(seed=-1), "--seed -1: .*at least 0"),
        (lambda: Recipe(width=8), "--width 8: .*at least 16"),
        (lambda: Recipe(arenas=()), "--arenas"),
        (lambda: ArenaRange(victims=(3, 1)), "--random.victims 3 1:"),
        (lambda: ArenaRange(painted=-1), "--random.painted -1: must be between 0 and 1"),
        (lambda: Recipe(lighting=(0, 0, 0)), r"--lighting 0 0 0:"),
        (lambda: Recipe(clear=float("nan")), "--clear nan: must be between 0 and 1"),
        (lambda: Recipe(dust=(0.5, 0.1)), "--dust 0.5 0.1:"),
        (lambda: Recipe(dust=(0, 3)), "dust must be from 0 to 1, not 3"),
    ],
)
def test_what_cannot_be_made_is_an_input_error(make, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()
