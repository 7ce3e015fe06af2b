"""What figures are said to hold for."""

import pytest

from sarsim.commands.provenance import instructions


@pytest.mark.parametrize(
    ("features", "name"), [("+sse2,+avx,+avx2,+avx512f", "AVX-512"), ("+avx2,-avx512f", "AVX2"), ("+sse2", "SSE")]
)
def test_the_instructions_are_those_that_numba_may_use(
    features: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("numba.config.CPU_FEATURES", features)
    assert instructions() == name
