"""The metric map's figures from very few frames."""

import numpy as np
import pytest

from pipeline.frame import Intrinsics
from pipeline.transforms import from_yaw
from scripts.benchmarks import metric_map
from scripts.benchmarks.metric_map import WARM_UP, RecordedFrames
from scripts.benchmarks.settings import MetricMapSettings


@pytest.mark.parametrize("frames", [1, WARM_UP - 1])
def test_fewer_frames_than_the_warm_up_suffice(frames: int, monkeypatch: pytest.MonkeyPatch) -> None:
    depth = np.full((frames, 6, 8), 1.5, np.float32)
    poses = np.stack([from_yaw(0, 0, 0, 0.1 * n) for n in range(frames)])
    recording = RecordedFrames(Intrinsics(8, 6, 7.0, 7.0, 4.0, 3.0), depth, depth, poses)
    monkeypatch.setattr(metric_map, "record", lambda *_: recording)
    monkeypatch.setattr(metric_map, "SIZES", (metric_map.SMALL,))
    figures = metric_map.measure(MetricMapSettings(frames=frames)).figures
    assert figures["ours.frame_ms"] > 0
    assert figures["large_over_small"] == 1
