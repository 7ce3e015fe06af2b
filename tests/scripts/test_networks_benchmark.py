"""The comparison of networks: the figures of each network."""

import json
from pathlib import Path

import pytest
import torch

from pipeline.errors import InputError
from pipeline.semantic_map.classifier import CLASSES, TruthClassifier
from pipeline.semantic_map.networks.blocks import CHANNELS, BlockConfig
from pipeline.semantic_map.networks.classifier import save_classifier
from pipeline.semantic_map.networks.weights import NETWORKS
from pipeline.semantic_map.rules import RuleClassifier
from scripts.benchmarks import networks
from scripts.benchmarks.labelled_drives import drive_through
from scripts.benchmarks.semantic_accuracy import KINDS, scores
from scripts.benchmarks.settings import NetworksSettings


def test_the_truth_is_right_and_the_vote_changes_what_is_not() -> None:
    seen = list(drive_through("nist_6x4", 2, seed=0))
    given = scores(seen, {"truth": TruthClassifier(), "rules": RuleClassifier()}, networks.VOTES)
    assert list(given) == ["truth", "truth.alone", "rules", "rules.alone"]
    assert given["truth.alone"]["frame"]["miou_four"] == given["truth.alone"]["fused"]["miou_four"] == 1
    assert min(given["truth"]["frame"][label] for label in ("wall", "terrain", "inclined_ramp")) > 0.98
    assert given["rules"]["frame"] != given["rules.alone"]["frame"]


def test_figures_have_the_agreed_names_and_are_means_over_arenas() -> None:
    one = {"pointnet.alone": {"frame": {"miou_four": 0.5, "wall": 1.0}, "voxels": {}, "fused": {"miou_four": 0.25}}}
    two = {"pointnet.alone": {"frame": {"miou_four": 0.7}, "voxels": {"wall": 0.4}, "fused": {"miou_four": 0.75}}}
    assert networks.group_figures("raf_mean.dark", [one, two]) == {
        "pointnet.miou_four.raf_mean.frame.alone.dark": pytest.approx(0.6),
        "pointnet.iou.wall.raf_mean.frame.alone.dark": 1.0,
        "pointnet.iou.wall.raf_mean.voxels.alone.dark": 0.4,
        "pointnet.miou_four.raf_mean.fused.alone.dark": 0.5,
    }


def test_a_small_comparison_has_accuracy_of_what_has_weights_and_times_of_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compared = {name: NETWORKS[name] for name in ("pointnet", "pointnext")}
    monkeypatch.setattr(networks, "NETWORKS", compared)
    torch.manual_seed(0)
    network = NETWORKS["pointnext"](CHANNELS, len(CLASSES))
    save_classifier(tmp_path / "pointnext.safetensors", network, BlockConfig(), {"processor_s": 12.5})
    result = networks.measure(
        NetworksSettings(
            rounds=1,
            timed_frames=1,
            frames=1,
            raf_frames=0,
            arenas=("nist_6x4",),
            lighting="normal",
            weights=tmp_path,
        )
    )
    for name in compared:
        assert {f"{name}.{figure}" for figure in ("parameters", "block_ms", "frame_s")} <= set(result.figures)
    assert result.figures["pointnext.train_s"] == 12.5
    accuracy = {key for key in result.figures if ".miou_four." in key}
    kinds = {kind + change for kind in KINDS for change in ("", ".alone")}
    assert accuracy == {f"pointnext.miou_four.nist_6x4.{kind}" for kind in kinds}
    assert json.dumps(result.details)
    assert result.table is not None
    assert (len(result.table.columns), result.table.row_count) == (3, 7)


@pytest.mark.parametrize(
    "change",
    [
        {"rounds": 0},
        {"timed_frames": 0},
        {"frames": -1},
        {"raf_frames": -1},
        {"random": -1},
        {"weights": Path("/no")},
    ],
)
def test_nothing_to_measure_is_refused(change: dict) -> None:
    with pytest.raises(InputError, match=r"at least|--weights"):
        networks.measure(NetworksSettings(**change))
