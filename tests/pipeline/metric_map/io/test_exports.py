"""PLY and map_server files, read by the programs that they are for or by hand."""

import cv2
import numpy as np
import open3d as o3d
import pytest

from pipeline.labels import COLOURS, Label
from pipeline.metric_map.io.exports import save_map_server, save_ply
from pipeline.metric_map.metric_map import MetricMap


@pytest.fixture
def wall_and_step():
    """A wall at x = 2 up to 1 m, a step of 0.15 m at x = 1, and free space between them and x = 0."""
    metric_map = MetricMap()
    for y in np.arange(-0.5, 0.5, 0.05):
        for z in np.arange(0.05, 1, 0.05):
            metric_map.integrate_points([(2.0, y, z)], (0, y, z))
        metric_map.integrate_points([(1.0, y, 0.15)], (0, y, 0.15))
    return metric_map


def test_open3d_reads_the_occupied_centres_and_their_colours(wall_and_step, tmp_path):
    labels = np.where(wall_and_step.occupied_centres()[:, 0] > 1.5, Label.WALL, Label.STRAIGHT_RAMP).astype(np.uint8)
    save_ply(tmp_path / "map.ply", wall_and_step, labels)
    cloud = o3d.io.read_point_cloud(str(tmp_path / "map.ply"))
    np.testing.assert_array_equal(np.asarray(cloud.points).astype(np.float32), wall_and_step.occupied_centres())
    np.testing.assert_array_equal(np.rint(np.asarray(cloud.colors) * 255), COLOURS[labels])


def test_map_server_sees_the_wall_and_drives_over_the_step(wall_and_step, tmp_path):
    save_map_server(tmp_path / "map.pgm", wall_and_step, 0.25, 0.65)
    image = cv2.imread(str(tmp_path / "map.pgm"), cv2.IMREAD_UNCHANGED)
    lines = (line.split(": ", 1) for line in (tmp_path / "map.yaml").read_text().splitlines())
    settings = dict(lines)
    assert settings["image"] == "map.pgm" and settings["negate"] == "0"
    x0, y0, _ = (float(word) for word in settings["origin"].strip("[]").split(","))
    resolution = float(settings["resolution"])

    def at(x, y):
        probability = (255 - int(image[-1 - int((y - y0) / resolution), int((x - x0) / resolution)])) / 255
        if probability > float(settings["occupied_thresh"]):
            return "occupied"
        return "free" if probability < float(settings["free_thresh"]) else "unknown"

    assert [at(x, 0.2) for x in (0.5, 1.0, 1.5, 2.0)] == ["free", "free", "free", "occupied"]


def test_what_no_voxel_shows_is_unknown(tmp_path):
    metric_map = MetricMap()
    metric_map.integrate_points([(1.0, 1.0, 0.5)], (0, 0, 0.5))
    save_map_server(tmp_path / "map.pgm", metric_map, 0.25, 0.65)
    image = cv2.imread(str(tmp_path / "map.pgm"), cv2.IMREAD_UNCHANGED)
    assert image[0, -1] == 0 and image[-1, 0] == 254 and image[0, 0] == 205


def test_a_slice_may_extend_beyond_the_map(wall_and_step, tmp_path):
    inf = float("inf")
    for name, heights in (("map", (-0.5, 1.5)), ("far", (-1e9, 1e9)), ("unlimited", (-inf, inf))):
        save_map_server(tmp_path / f"{name}.pgm", wall_and_step, *heights)
    expected = (tmp_path / "map.pgm").read_bytes()
    assert (tmp_path / "far.pgm").read_bytes() == (tmp_path / "unlimited.pgm").read_bytes() == expected
    save_map_server(tmp_path / "above.pgm", wall_and_step, 50.0, inf)
    image = cv2.imread(str(tmp_path / "above.pgm"), cv2.IMREAD_UNCHANGED)
    assert (image == 205).all()
    assert image.shape == cv2.imread(str(tmp_path / "map.pgm"), cv2.IMREAD_UNCHANGED).shape


def test_a_map_without_known_voxels_is_one_unknown_cell(tmp_path):
    save_map_server(tmp_path / "map.pgm", MetricMap(), 0.25, 0.65)
    assert cv2.imread(str(tmp_path / "map.pgm"), cv2.IMREAD_UNCHANGED).tolist() == [[205]]
