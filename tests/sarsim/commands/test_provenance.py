"""What figures are said to hold for."""

import subprocess
from pathlib import Path

import pytest

from sarsim.commands import provenance
from sarsim.commands.provenance import instructions, state_of_code


@pytest.mark.parametrize(
    ("features", "name"), [("+sse2,+avx,+avx2,+avx512f", "AVX-512"), ("+avx2,-avx512f", "AVX2"), ("+sse2", "SSE")]
)
def test_the_instructions_are_those_that_numba_may_use(
    features: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("numba.config.CPU_FEATURES", features)
    assert instructions() == name


@pytest.mark.parametrize(
    ("path", "counts"),
    [
        ("sarsim/main.py", True),
        ("assets/missions/virtual.yaml", True),
        ("assets/splits/test.yaml", True),
        ("assets/weights/rooms.yaml", False),  # how a network was trained, which its weights already state
        ("docs/results/pages.yaml", False),
    ],
)
def test_a_change_counts_if_figures_depend_on_the_file(
    path: str, counts: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(provenance, "ROOT", tmp_path)
    for name in ("sarsim/kept.py", path):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("before")
    author = "-c", "user.name=n", "-c", "user.email=e"
    for words in (("init",), ("add", "."), (*author, "commit", "-m", "m")):
        subprocess.run(["git", *words], cwd=tmp_path, check=True, capture_output=True)
    assert not state_of_code().endswith("+")
    (tmp_path / path).write_text("after")
    assert state_of_code().endswith("+") == counts
