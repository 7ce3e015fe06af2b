"""2D maps as ROS's map_server has them."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.arenas.map_2d import WALL_HEIGHT, build_map, read_map, rectangles

PLAN = ["##########", "#........#", "#......#.#", "#........#", "#........#", "##########"]
"""From the top; a pixel is 0.5 m."""


def write(folder, pixels, text="", name="map.pgm", mode=None):
    Image.fromarray(np.array(pixels, np.uint8), mode).save(folder / name)
    path = folder / "map.yaml"
    fixed = f"image: {name}\nresolution: 0.5\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    path.write_text(fixed + (text or "origin: [0, 0, 0]\n"))
    return path


def plan():
    return [[0 if cell == "#" else 254 for cell in row] for row in PLAN]


@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (-3.0, 2.0, 0.0), (1.0, -2.0, 0.7)])
def test_every_pixel_is_where_the_file_says(tmp_path, origin):
    pixels = np.array(plan())
    path = write(tmp_path, pixels, f"origin: {list(origin)}\n")
    model = mujoco.MjModel.from_xml_string(build_map(path).to_xml())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    x0, y0, yaw = origin
    turn = np.array([(np.cos(yaw), -np.sin(yaw)), (np.sin(yaw), np.cos(yaw))])
    geom = np.zeros(1, np.int32)
    for row, line in enumerate(pixels[::-1]):
        for column, value in enumerate(line):
            for inset in (0.002, 0.498):  # 2 mm inside two corners of the pixel
                x, y = (x0, y0) + turn @ (0.5 * column + inset, 0.5 * row + inset)
                height = 3 - mujoco.mj_ray(
                    model, data, np.array([x, y, 3.0]), np.array([0.0, 0, -1]), None, 1, -1, geom, None
                )
                assert height == pytest.approx(WALL_HEIGHT if value == 0 else 0.0, abs=1e-3)


def test_the_robot_starts_in_the_room(tmp_path):
    x, y = load_arena(str(write(tmp_path, plan()))).T_world_start[:2, 3]
    assert 0.5 < x < 4.5 and 0.5 < y < 2.5


@given(arrays(np.bool_, st.tuples(st.integers(1, 8), st.integers(1, 8))))
def test_rectangles_fill_the_cells_once(cells):
    filled = np.zeros(cells.shape, np.int64)
    for (row, column), (last, end) in rectangles(cells):
        filled[row:last, column:end] += 1
    np.testing.assert_array_equal(filled, cells)


def test_few_rectangles_are_enough():
    assert len(rectangles(np.ones((5, 7), np.bool_))) == 1
    assert len(rectangles(np.array([[c == "#" for c in row] for row in PLAN]))) == 5


@pytest.mark.parametrize(
    ("mode", "text", "value", "occupied"),
    [
        ("L", "mode: trinary", 89, True),  # (255 - 89) / 255 = 0.651
        ("L", "mode: trinary", 90, False),
        ("L", "negate: 1", 166, True),
        ("L", "negate: 1", 165, False),
        ("L", "mode: raw", 66, True),
        ("L", "mode: raw", 65, False),
        ("L", "mode: raw", 205, False),  # unknown
        ("RGB", "mode: scale", (0, 0, 255), True),
        ("RGBA", "mode: trinary", (80, 80, 80, 255), False),  # with alpha the mean is 124
        ("RGBA", "mode: scale", (80, 80, 80, 255), True),
    ],
)
def test_a_pixel_is_occupied_as_in_ros(tmp_path, mode, text, value, occupied):
    path = write(tmp_path, [[value]], f"origin: [0, 0, 0]\n{text}\n", "map.png")
    assert read_map(path).occupied.tolist() == [[occupied]]


def test_the_ground_lies_under_what_is_known(tmp_path):
    pixels = np.full((400, 400), 205, np.uint8)  # 205 is unknown; 200 m × 200 m would be too large
    pixels[300:306, 100:110] = plan()
    path = write(tmp_path, pixels)
    x, y = load_arena(str(path)).T_world_start[:2, 3]
    assert 50 < x < 55 and 47 < y < 50
    model = mujoco.MjModel.from_xml_string(build_map(path).to_xml())
    np.testing.assert_allclose(model.geom_pos[0], [52.5, 48.5, 0])
    np.testing.assert_allclose(model.geom_size[0, :2], [2.5, 1.5])


def test_16_bits_are_read_as_8(tmp_path):
    Image.fromarray(np.array([[0, 257 * 89, 257 * 90]], np.uint16)).save(tmp_path / "m.png")
    (tmp_path / "map.yaml").write_text("image: m.png\nresolution: 1\norigin: [0, 0, 0]\n")
    assert read_map(tmp_path / "map.yaml").occupied.tolist() == [[True, True, False]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("image: none.pgm\norigin: [0, 0, 0]", r"none\.pgm: cannot be read: No such file"),
        ("image: ../map.pgm\norigin: [0, 0, 0]", r"the image .*map\.pgm must be in the folder"),
        ("image: map.yaml\norigin: [0, 0, 0]", "cannot be read as an image: "),
        ("origin: [0, 0]", r"origin must be \[x, y, yaw\] .*, not \[0, 0\]"),
        ("origin: [0, .nan, 0]", "origin must be a number .*, not 'nan'"),
        ("origin: [0, 0, 0]\nresolution: 0", "resolution must be .* 0.001 .*, not '0'"),
        ("origin: [0, 0, 0]\nfree_thresh: 0.7", r"free_thresh \(0\.7\) must be .* \(0\.65\)"),
        ("origin: [0, 0, 0]\noccupied_thresh: 65", "occupied_thresh must be .* 0 to 1, not '65'"),
        ("origin: [0, 0, 0]\nmode: fuzzy", "mode must be trinary, scale or raw, not 'fuzzy'"),
        ("origin: [0", "cannot be parsed as YAML: "),
        ("- a", "cannot be parsed as YAML: "),
    ],
)
def test_wrong_maps_are_one_line(tmp_path, text, said):
    path = write(tmp_path, plan(), text)
    with pytest.raises(InputError, match=said) as error:
        load_arena(str(path))
    assert str(tmp_path) in str(error.value) and "\n" not in str(error.value)


def test_a_map_without_walls_or_with_too_many_pixels_or_boxes_is_refused(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="no pixel is occupied"):
        build_map(write(tmp_path, [[254, 254]]))
    monkeypatch.setattr("sarsim.arenas.map_2d.MAX_GEOMS", 3)
    with pytest.raises(InputError, match=r"5 boxes.*3"):
        build_map(write(tmp_path, plan()))
    monkeypatch.setattr("sarsim.arenas.map_2d.MAX_PIXELS", 20)
    with pytest.raises(InputError, match="10 × 6 pixels"):
        build_map(write(tmp_path, plan()))
    (tmp_path / "map.yaml").write_text("a: 1")
    with pytest.raises(InputError, match="image, resolution and origin"):
        build_map(tmp_path / "map.yaml")
