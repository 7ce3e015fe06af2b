import re
import shutil

import numpy as np
import pytest
from PIL import Image, TiffImagePlugin, TiffTags

from pipeline.errors import InputError
from pipeline.plugins.league.config import ValidationConfig
from pipeline.plugins.league.validation import map_errors, validate
from tests.pipeline.plugins.league.handed_in_room import BRIEF, hand_in_room, room_points


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    folder = tmp_path_factory.mktemp("good")
    hand_in_room(folder)
    return folder


@pytest.fixture
def folder(good, tmp_path):
    shutil.copytree(good, tmp_path / "team")
    return tmp_path / "team"


def test_what_this_program_hands_in_is_accepted(good):
    assert validate(good) == []


def test_an_episode_contains_its_files(good, tmp_path):
    shutil.copytree(good, tmp_path / "handed_in")
    (tmp_path / "other.ply").write_text("")
    assert validate(tmp_path) == []


def test_without_any_file_there_is_nothing_to_judge(tmp_path):
    with pytest.raises(InputError, match=tmp_path.name):
        validate(tmp_path)
    with pytest.raises(InputError, match="none"):
        validate(tmp_path / "none")


@pytest.mark.parametrize(
    ("name", "what"),
    [(BRIEF.map_2d_name, "2D map"), (BRIEF.cloud_name, "3D map"), (BRIEF.pois_name, "list of finds")],
)
def test_a_missing_file_is_reported(folder, name, what):
    (folder / name).unlink()
    (fault,) = validate(folder)
    assert what in fault


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (BRIEF.map_2d_name, "map.tiff"),
        (BRIEF.map_2d_name, "RoboCup2026-Other-lab.tiff"),
        (BRIEF.cloud_name, "RoboCup2025-Team_B_-lab.ply"),
        (BRIEF.pois_name, "pois.csv"),
        (BRIEF.pois_name, BRIEF.pois_name.replace("14-30", "15-30")),
    ],
)
def test_wrong_names_are_reported(folder, old, new):
    (folder / old).rename(folder / new)
    (line,) = validate(folder)
    assert line.startswith(f"{new}: ") and "name" in line


@pytest.mark.parametrize(
    ("points", "fault"),
    [
        (100 * room_points(), "400 m"),
        (room_points() / 10, "0.4 m"),
        (room_points() + np.array([9, 0, 0]), "origin"),
        (room_points() + np.array([0, 0, 0.3]), "floor .* 0.30 m"),
        (room_points() * [1, -1, -1], "floor .* -"),
    ],
)
def test_a_cloud_of_another_scale_or_origin_is_reported(folder, points, fault):
    hand_in_room(folder, points)
    (line,) = validate(folder)
    assert re.match(f"{BRIEF.cloud_name}: .*{fault}", line)


def test_a_cloud_without_the_names_is_reported(folder):
    path = folder / BRIEF.cloud_name
    path.write_text(path.read_text().replace("mission: lab", "mission: other"))
    (line,) = validate(folder)
    assert line.startswith(path.name) and "mission" in line


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("200 200 200", "200 256 200", "colours"),
        ("1.00 0.98", "2.00 0.98", "normals"),
        ("1.00 0.98", "1.00 98", "confidences"),
    ],
)
def test_extras_out_of_range_are_reported(folder, old, new, fault):
    path = folder / BRIEF.cloud_name
    path.write_text(path.read_text().replace(old, new, 1))
    (line,) = validate(folder)
    assert line.startswith(f"{path.name}: {fault}")


@pytest.fixture
def picture(good):
    with Image.open(good / BRIEF.map_2d_name) as file:
        return np.array(file)


def saved(path, image, pixel=(0.01, 0.01, 0.0), kind=TiffTags.DOUBLE):
    """Write an image with the given sides of a pixel, m, as numbers of a type of TIFF."""
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    if pixel:
        tags.tagtype[33550], tags[33550] = kind, pixel
    Image.fromarray(image).save(path, "TIFF", tiffinfo=tags)
    return path


def test_a_picture_without_a_size_of_its_pixels_is_reported(picture, tmp_path):
    path = saved(tmp_path / "a.tiff", picture, ())
    (fault,) = map_errors(path, set(), ValidationConfig())
    assert "ModelPixelScale" in fault


def test_a_wrong_size_of_pixels_is_reported(picture, tmp_path):
    path = saved(tmp_path / "a.tiff", picture, (0.02, 0.02, 0.0))
    (fault,) = map_errors(path, set(), ValidationConfig())
    assert "100 pixels of 0.02 m" in fault


def test_a_size_of_pixels_in_fractions_is_read(picture, tmp_path):
    path = saved(tmp_path / "a.tiff", picture, (0.01, 0.01, 0.0), TiffTags.RATIONAL)
    assert map_errors(path, set(), ValidationConfig()) == []


@pytest.mark.parametrize(
    ("colour", "fault"),
    [
        ((0, 44, 207), "no file name"),
        ((0, 240, 0), "no start"),
        ((0, 40, 120), "no walls"),
        ((120, 0, 140), "no path"),
        ((255, 200, 0), "no ar code"),
        ((226, 226, 227), "no checkerboard"),
    ],
)
def test_missing_elements_are_reported(picture, tmp_path, colour, fault):
    picture[(picture == np.array(colour)).all(axis=-1)] = (237, 237, 238)
    (line,) = map_errors(saved(tmp_path / "a.tiff", picture), {"ar_code"}, ValidationConfig())
    assert line.startswith(fault)


def test_another_kind_of_picture_is_reported(tmp_path):
    (tmp_path / "a.tiff").write_text("no picture")
    assert map_errors(tmp_path / "a.tiff", set(), ValidationConfig())[0].count("TIFF")
    Image.fromarray(np.zeros((9, 9), np.uint8)).save(tmp_path / "b.tiff")
    assert len(map_errors(tmp_path / "b.tiff", set(), ValidationConfig())) == 1
