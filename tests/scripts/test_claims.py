"""Claims: which hold, and what is printed of them."""

from pathlib import Path
from typing import Any

import pytest

from scripts import claims
from scripts.claims import holds, verdict
from scripts.results import plan, record_of

LEAST = {"claim": "fast", "page": "camera", "figure": "times", "least": 2}
MOST = {"claim": "exact", "page": "camera", "figure": "error", "most": 0.5}


@pytest.mark.parametrize(("figure", "held"), [(1.9, False), (2.0, True), (2.1, True), (float("nan"), False)])
def test_a_claim_holds_from_its_bound_on(figure: float, held: bool) -> None:
    assert holds(LEAST, {"times": figure}) is held
    assert holds({"figure": "times", "most": 2}, {"times": 4 - figure}) is held


def test_a_figure_that_is_missing_is_a_failure() -> None:
    assert not holds(LEAST, {})
    assert verdict(LEAST, {}) == "FAILS  fast: missing, expected ≥ 2"


def test_all_claims_of_a_command_are_checked_by_one_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    commands: list[str] = []

    def measured(command: str, folder: Path) -> dict[str, Any]:
        commands.append(command)
        return {"figures": {"times": 3.0, "error": 0.6}}

    content = {"pages": {"camera": {"command": "benchmark.py camera"}}, "claims": [LEAST, MOST]}
    monkeypatch.setattr(claims, "plan", lambda: content)
    monkeypatch.setattr(claims, "measured", measured)
    with pytest.raises(SystemExit):
        claims.claims()
    assert commands == ["benchmark.py camera"]
    printed = ["holds  fast: 3, expected ≥ 2", "FAILS  exact: 0.6, expected ≤ 0.5"]
    assert capsys.readouterr().out.splitlines() == printed


def test_every_claim_held_when_its_page_was_measured() -> None:
    for claim in plan()["claims"]:
        record = record_of(claim["page"])
        assert record and holds(claim, record["figures"]), claim["claim"]
