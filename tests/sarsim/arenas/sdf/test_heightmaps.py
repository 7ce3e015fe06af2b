"""Heightmaps as ground: MuJoCo's rays and the true surface against the picture's numbers."""

import logging

import numpy as np
import pytest
from PIL import Image

from pipeline.errors import InputError
from pipeline.labels import Label
from sarsim.arenas.load import load_arena
from sarsim.arenas.sdf.build import build_sdf
from sarsim.ground_truth.true_surface import Survey
from tests.sarsim.arenas.sdf.worlds import Compiled, box, model, write

MM = 1e-3
DOWN = (0, 0, -1)


def heightmap(uri, size, pos="0 0 0"):
    return (
        f"<collision name='c'><geometry><heightmap><uri>{uri}</uri><size>{size}</size><pos>{pos}</pos></heightmap>"
        "</geometry></collision>"
    )


def picture(path, pixels):
    Image.fromarray(pixels).save(path)
    return path.name


def hills(rows=33, columns=33):
    y, x = np.mgrid[:rows, :columns]
    return (np.sin(x / 5) * np.cos(y / 7) + 1) / 2


@pytest.mark.parametrize(("kind", "top"), [(np.uint8, 255), (np.uint16, 65535)])
def test_the_brightest_pixel_is_as_high_as_the_size_and_the_upper_edge_is_at_plus_y(tmp_path, kind, top):
    pixels = (hills() * 0.6 * top).astype(kind)  # nothing in it is white
    uri = picture(tmp_path / "h.png", pixels)
    arena = Compiled(write(tmp_path, model("m", heightmap(uri, "16 8 2", "1 2 0.5"), pose="0 0 1 0 0 0")))
    for row, column in np.random.default_rng(0).integers(1, 32, (40, 2)):
        x, y = 1 + 16 * (column / 32 - 0.5), 2 + 8 * (0.5 - row / 32)
        expected = 1.5 + 2 * float(pixels[row, column]) / float(pixels.max())
        assert 9 - arena.ray(x, y, 9, along=DOWN) == pytest.approx(expected, abs=MM)


def test_the_true_ground_is_what_rays_hit(tmp_path):
    uri = picture(tmp_path / "h.png", (hills() * 255).astype(np.uint8))
    arena = Compiled(write(tmp_path, model("m", heightmap(uri, "16 16 1"), pose=f"0 0 0 0 0 {np.pi / 6}")))
    ground = Survey(arena.model, arena.data).ground_from(np.array([0.1, 0.2, 9 - arena.ray(0.1, 0.2, 9, along=DOWN)]))
    known = np.argwhere(~np.isnan(ground.height))
    assert len(known) > 20_000
    for cell in known[:: len(known) // 100]:
        x, y = ground.grid.centre_of(cell)
        assert 9 - arena.ray(x, y, 9, along=DOWN) == pytest.approx(ground.height[tuple(cell)], abs=MM)
    assert set(np.unique(ground.label[~np.isnan(ground.height)])) <= {
        Label.TERRAIN,
        Label.INCLINED_RAMP,
        Label.CLUTTER,
    }


def test_natural_ground_is_labelled_by_its_slope_and_what_stands_on_it_by_its_height_above_it(tmp_path):
    x = np.arange(33)
    steps = np.interp(x, [0, 16, 24, 32], [0, 0, 40, 255])  # level, then 17°, then 59°
    uri = picture(tmp_path / "h.png", np.tile(steps.astype(np.uint8), (33, 1)))
    crate = model("crate", box(2, 2, 0.4), pose="-8 0 0.2 0 0 0")
    arena = Compiled(write(tmp_path, model("m", heightmap(uri, "32 32 16")), crate))
    along = [arena.label_below(x, 8) for x in (-10, 4, 12)]
    assert along == [Label.TERRAIN, Label.INCLINED_RAMP, Label.CLUTTER]
    assert arena.label_below(-8, 0) == Label.STRAIGHT_RAMP


def test_a_robot_starts_on_a_heightmap(tmp_path):
    uri = picture(tmp_path / "h.png", (hills() * 255).astype(np.uint8))
    x, y, z = load_arena(str(write(tmp_path, model("m", heightmap(uri, "16 16 1"))))).T_world_start[:3, 3]
    assert abs(x) < 8 and abs(y) < 8 and 0 <= z <= 1


def test_a_flat_picture_and_a_negative_height_are_ground_too(tmp_path):
    black = picture(tmp_path / "b.png", np.zeros((5, 5), np.uint8))
    flat = Compiled(write(tmp_path, model("m", heightmap(black, "8 8 2"))))
    assert flat.ray(1.1, 1.2, 5, along=DOWN) == pytest.approx(5, abs=MM)
    slope = picture(tmp_path / "s.png", np.tile(np.arange(0, 250, 50, np.uint8), (5, 1)))
    arena = Compiled(write(tmp_path, model("m", heightmap(slope, "8 8 -2"))))
    assert 5 - arena.ray(-3.9, 0.1, 5, along=DOWN) == pytest.approx(2 - 0.1 / 4, abs=MM)


@pytest.mark.parametrize(
    ("name", "content"), [("h.tif", b"II*"), ("h.png", b"no picture"), ("gone.png", None), ("one.png", "one")]
)
def test_a_heightmap_that_cannot_be_read_is_named(tmp_path, name, content, caplog):
    if content == "one":
        picture(tmp_path / name, np.zeros((1, 1), np.uint8))
    elif content is not None:
        (tmp_path / name).write_bytes(content)
    if content is not None:
        with pytest.raises(InputError, match=name):
            build_sdf(write(tmp_path, model("m", heightmap(name, "8 8 2"))))
    with caplog.at_level(logging.WARNING):
        build_sdf(write(tmp_path, model("m", heightmap(name, "8 8 2")), model("n", box(1, 1, 1))))
    (line,) = caplog.messages
    assert name in line
