"""Check the claims of README's section Reproduce: ``claims.py``."""

import sys
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

try:
    from sarsim.commands.cli import run
except ModuleNotFoundError as error:
    raise SystemExit(
        f"error: {error.name} is not installed; run: make develop && source .venv/bin/activate"
    ) from None

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # scripts/ is not installed
from scripts.results import ROOT, expected, measured, number, plan

FAILED = 1  # Exit status if a claim does not hold


def claims() -> None:
    """Run the commands of all claims, report which claims hold, and end with status 1 unless all do."""
    content, failed = plan(), 0
    for name, group in groupby(content["claims"], lambda claim: claim["page"]):
        figures = measured(content["pages"][name]["command"], ROOT / "runs" / "claims" / name)["figures"]
        for claim in group:
            failed += not holds(claim, figures)
            print(verdict(claim, figures), flush=True)
    if failed:
        raise SystemExit(FAILED)


def holds(claim: Mapping[str, Any], figures: Mapping[str, float]) -> bool:
    """Whether the figure that a claim names exists and is within its bounds."""
    figure = figures.get(claim["figure"], float("nan"))
    return bool(claim.get("least", figure) <= figure <= claim.get("most", figure))


def verdict(claim: Mapping[str, Any], figures: Mapping[str, float]) -> str:
    """A line that says whether a claim holds."""
    word = "holds" if holds(claim, figures) else "FAILS"
    figure = figures.get(claim["figure"])
    value = "missing" if figure is None else number(figure)
    return f"{word}  {claim['claim']}: {value}, expected {expected(claim)}"


def main() -> None:
    """Entry point."""
    run(claims)


if __name__ == "__main__":
    main()
