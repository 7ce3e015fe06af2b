"""Check random arenas on their true geometry: ``check_arenas.py --seeds 200``."""

import sys
from time import perf_counter

from rich.console import Console
from rich.progress import track
from rich.table import Table

from pipeline.errors import InputError
from sarsim.arenas.checks import failed_checks
from sarsim.arenas.random_arena import RandomArenaConfig, build_random
from sarsim.scripts.cli import run

_DEFAULT = RandomArenaConfig()


def check_arenas(seeds: int = 200, first: int = 0, random: RandomArenaConfig = _DEFAULT) -> None:
    """Build arenas, survey each anew and print the checks that they fail; the exit status is 1 if one fails.

    Args:
        seeds: number of arenas.
        first: seed.
        random: what they are like.
    """
    if seeds < 1 or first < 0:
        raise InputError(f"--seeds {seeds} --first {first}: at least 1 arena, and no negative seed")
    table, seconds, bad = Table("seed", "failed checks"), [], 0
    for seed in track(range(first, first + seeds), console=Console(stderr=True)):
        before = perf_counter()
        builder = build_random(seed, random)
        seconds.append(perf_counter() - before)
        if broken := failed_checks(builder.to_xml()):
            bad += 1
            table.add_row(str(seed), "; ".join(broken))
    console = Console()
    if bad:
        console.print(table)
    mean, slowest = sum(seconds) / len(seconds), max(seconds)
    console.print(f"{seeds} arenas, {bad} fail a check; built in {mean:.2f} s each, {slowest:.2f} s at most")
    if bad:
        sys.exit(1)


def main() -> None:
    """Entry point."""
    run(check_arenas)


if __name__ == "__main__":
    main()
