"""Weights from files: this project's, published ones, and files that hold no DGCNN."""

import json
import pickle
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file, save_file

from pipeline.errors import InputError
from pipeline.semantic_map.networks.tensor_file import read_tensors
from pipeline.semantic_map.networks.weights import load_weights, save_weights
from tests.pipeline.semantic_map.networks.small_network import block, network, plain


def saved(path: Path, **changes):
    """A file of weights with some tensors changed, or left out where None is given."""
    save_weights(path, network())
    tensors = load_file(path) | changes
    save_file({name: tensor for name, tensor in tensors.items() if tensor is not None}, path)
    return path


def test_what_was_saved_is_loaded(tmp_path: Path) -> None:
    path, original = tmp_path / "w.safetensors", network(channels=9, classes=13)
    original.k = 12
    save_weights(path, original, {"note": "hello"})
    loaded, metadata = load_weights(path)
    assert (loaded.channels, loaded.classes, loaded.k) == (9, 13, 12)
    assert metadata["note"] == "hello"
    assert not loaded.training
    x = block(50, channels=9)
    assert (plain(loaded, x) == plain(original, x)).all()


def test_weights_are_as_readable_as_any_other_new_file(tmp_path: Path) -> None:
    save_weights(tmp_path / "w.safetensors", network())
    (tmp_path / "other").touch()
    assert (tmp_path / "w.safetensors").stat().st_mode == (tmp_path / "other").stat().st_mode


def test_batch_norms_registered_twice_are_read_once(tmp_path: Path) -> None:
    path = saved(tmp_path / "w.safetensors")
    tensors = load_file(path)
    twice = {f"conv{n[2]}.1.{n[4:]}": t.clone() for n, t in tensors.items() if n.startswith("bn")}
    save_file(tensors | twice, path)
    x = block(50)
    assert (plain(load_weights(path)[0], x) == plain(network(), x)).all()


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"conv1.0.weight": None}, r"not a DGCNN.*conv1\.0\.weight is missing"),
        ({"conv9.weight": None}, r"not a DGCNN.*conv9\.weight is missing"),
        ({"conv1.0.weight": torch.zeros(3)}, "not a DGCNN"),
        ({"conv1.0.weight": torch.zeros(0, 2_000_000_000, 1, 1)}, "not a DGCNN"),
        ({"conv9.weight": torch.zeros(2_000_000_000, 0, 1)}, "not a DGCNN"),
        ({"conv9.weight": torch.zeros(0, 256, 1)}, "not a DGCNN"),
        ({"bn2.running_var": torch.full((64,), -1.0)}, "bn2.running_var"),
        ({"bn2.weight": torch.ones(64, dtype=torch.complex64)}, "bn2.weight"),
        ({"conv4.0.weight": None}, r"missing tensor: conv4\.0\.weight\)"),
        ({"bn3.bias": None, "bn3.weight": None}, r"missing tensors: bn3\.bias and 1 more\)"),
        ({"conv10.weight": torch.zeros(1)}, r"unexpected tensor: conv10\.weight\)"),
        ({"conv6.0.weight": torch.zeros(512, 192, 1)}, r"conv6.0.weight has shape \(512, 192, 1\), but must have \("),
        ({"conv1.0.weight": torch.zeros(64, 13, 1, 1)}, r"\(64, 13, 1, 1\)"),
        ({"bn2.weight": torch.full((64,), torch.nan)}, "bn2.weight"),
    ],
)
def test_weights_of_another_network_are_refused(tmp_path: Path, changes: dict, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        load_weights(saved(tmp_path / "w.safetensors", **changes))


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (pickle.dumps({"a": 1}), "pickle"),
        (b"PK\x03\x04 what torch.save writes", "pickle"),
        (b"", "safetensors"),
        (b"\xff" * 100, "safetensors"),
        (None, "safetensors"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, content: bytes | None, complaint: str) -> None:
    path = saved(tmp_path / "w.safetensors")
    path.write_bytes(path.read_bytes()[:-1] if content is None else content)
    with pytest.raises(InputError, match=complaint):
        load_weights(path)


@pytest.mark.parametrize("magic", [b"\x80\x02", b"\x80\x05", b"PK"])
def test_a_header_may_be_as_long_as_a_pickle_begins(tmp_path: Path, magic: bytes) -> None:
    header = json.dumps({"x": {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}})
    content = header.ljust(int.from_bytes(magic, "little")).encode() + b"\0\0\x80?"
    (tmp_path / "w.safetensors").write_bytes(magic.ljust(8, b"\0") + content)
    tensors, _ = read_tensors(tmp_path / "w.safetensors")
    assert tensors["x"].tolist() == [1.0]


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"w\.safetensors"):
        load_weights(tmp_path / "w.safetensors")


@pytest.mark.parametrize(
    ("metadata", "complaint"),
    [
        ({"network": "yolo"}, "weights of 'yolo', but must contain those of pointnet, "),
        *(({"k": k}, "k = .* 1 to 64") for k in ("x", "", "0", "-1", "65", "1e3", "9" * 9)),
    ],
)
def test_metadata_that_does_not_fit_is_refused(tmp_path: Path, metadata: dict, complaint: str) -> None:
    save_weights(tmp_path / "w.safetensors", network(), metadata)
    with pytest.raises(InputError, match=complaint):
        load_weights(tmp_path / "w.safetensors")
