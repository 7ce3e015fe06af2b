"""Write the splits of arenas, with their checksums, to ``assets/splits``.

Run this only to introduce a new set of arenas: results measured on the old set are not comparable with new ones.
"""

from collections.abc import Iterator
from itertools import count, islice

import yaml

from pipeline.errors import InputError
from pipeline.files import atomic_write
from sarsim.assets import asset
from sarsim.commands.cli import tracked
from sarsim.commands.sweeps.arenas import ARENAS, GRID, MAPS, checksum
from sarsim.tasks.grid_scenes import DRAWINGS

BUILT = {"train": (), "val": (), "test": ("nist_6x4", "esogu_52x15")}
"""Arenas of each split that are not drawn at random."""


def drawn(first: int) -> Iterator[str]:
    """Random arenas in which the robot can start, with seeds from ``first`` on and all but the hardest difficulty."""
    for seed in count(first):
        try:
            if seed % 4 != 3 and checksum(f"random:{seed}"):
                yield f"random:{seed}"
        except InputError:
            continue


def main() -> None:
    """Entry point."""
    for split, first in tracked(DRAWINGS.items(), "splits"):
        mujoco = [*BUILT[split], *islice(drawn(first), ARENAS - len(BUILT[split]))]
        maps = [f"{GRID}{split}:{number}" for number in range(MAPS)]
        content = {"mujoco": {n: checksum(n) for n in mujoco}, "grid": {n: checksum(n) for n in maps}}
        with atomic_write(asset("splits", f"{split}.yaml")) as part:
            part.write_text(yaml.safe_dump(content, sort_keys=False))


if __name__ == "__main__":
    main()
