"""The page's arena, reader of finds and sink in a short episode, and in a recording of it."""

import csv
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pipeline.map_file import load_keyframes
from pipeline.mapper import Mapper
from pipeline.metric_map.io.npz import load_metric_map
from pipeline.semantic_map.classifier import TruthClassifier
from sarsim.commands.map_recording import map_recording
from sarsim.commands.run_episode import run_episode
from sarsim.commands.settings import run_with_settings
from sarsim.settings import EpisodeConfig, MapRecordingConfig
from tests.pipeline.robot_model import PIONEER
from tests.recordings import read
from tests.refusal import refusal
from tests.source_tree import ROOT

OWN = ["--reader", "own_page:Red", "--sink", "own_page:Poses"]
QUICK = ["--labels", "truth", "--detector", "None"]
RED = (2.5 + 0.1 * 4 - 0.13, 0.2, 0.5)
"""Where the page puts the front of its red square, m, with seed 4."""
LATE = """
from pipeline.sink import Sink


class Late(Sink):
    def finish(self, result):
        raise OSError("the disk is full")
"""


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A working folder with the code of the page, and a run in it that was also written as a TUM sequence."""
    folder = tmp_path_factory.mktemp("own")
    page = (ROOT / "docs" / "extend.md").read_text()
    code = "\n".join(re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE))
    (folder / "own_page.py").write_text(code + LATE)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.delitem(sys.modules, "own_page", raising=False)
        flags = ["--arena", "own_page:hall", "--seed", "4", "--steps", "1", "--out", "run", "--tum", "tum"]
        run_with_settings(run_episode, EpisodeConfig, [*flags, *OWN, *QUICK])
        yield folder


@pytest.fixture
def run(workplace: Path) -> Path:
    return workplace / "run"


def positions(folder: Path) -> np.ndarray:
    """What the sink has written, t x y z."""
    head, *rows = csv.reader((folder / "poses.csv").open())
    assert head == ["time_s", "x_m", "y_m", "z_m"]
    return np.array(rows, np.float64)


def squares(folder: Path) -> list[dict]:
    """What the reader has found, as it is reported."""
    return [find for find in json.loads((folder / "finds.json").read_text()) if find["kind"] == "red_square"]


def test_the_sink_writes_where_the_robot_was(run: Path) -> None:
    written, estimated = positions(run), np.loadtxt(run / "trajectory_estimated.tum")
    assert len(written) == json.loads((run / "report.json").read_text())["localisation"]["keyframes"] > 1
    nearest = np.abs(estimated[:, 0] - written[:, :1]).argmin(axis=1)
    np.testing.assert_allclose(written[:, 1:], estimated[nearest, 1:4], atol=0.01)


def test_what_the_reader_finds_is_reported_where_it_is_and_drawn(run: Path) -> None:
    (square,) = squares(run)
    np.testing.assert_allclose(square["position"], RED, atol=0.12)
    assert square["confidence"] > 0.5 and (run / square["photo"]).exists()
    recorded = read(run / "episode.rrd")
    assert "red square" in str(recorded["/world/finds"]) and recorded["/world/robot/camera/finds"]


def test_a_later_run_in_this_map_has_the_find(run: Path) -> None:
    mapper = Mapper(PIONEER, TruthClassifier())
    load_keyframes(run / "keyframes.npz", mapper)
    (find,) = mapper.finds.reported
    assert find.kind == "red_square"
    np.testing.assert_allclose(find.position, squares(run)[0]["position"], atol=0.01)


def test_the_arena_is_the_functions_own_with_the_seed(run: Path) -> None:
    report = json.loads((run / "report.json").read_text())
    assert report["arena"] == "own_page:hall"
    assert report["semantic_map"]["iou"].keys() == {"wall", "terrain", "clutter"}
    farthest = load_metric_map(run / "metric_map.npz").occupied_centres()[:, 0].max()
    assert farthest == pytest.approx(2.5 + 0.1 * 4 - 0.1, abs=0.15)


def test_its_config_file_alone_runs_no_code(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = ["--config", str(run / "config.yaml")]
    line = refusal(capsys, run_with_settings, run_episode, EpisodeConfig, config)
    assert "config.yaml" in line and re.search("--(arena|reader|sink) as a flag", line)


def test_a_recording_has_them_too_and_a_sink_that_fails_costs_its_own_result_alone(workplace: Path) -> None:
    out = workplace / "mapped"
    flags = [str(workplace / "tum"), "--out", str(out), *OWN, "--sink", "own_page:Late", *QUICK, "--labels", "rules"]
    with pytest.raises(OSError, match="the disk is full"):
        run_with_settings(map_recording, MapRecordingConfig, flags)
    assert len(positions(out)) > 1
    (square,) = squares(out)
    np.testing.assert_allclose(square["position"], RED, atol=0.2)
    assert {"report.json", "report.html", "keyframes.npz", "config.yaml"} <= {path.name for path in out.iterdir()}
