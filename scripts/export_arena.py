"""Write any arena as plain MJCF, which MuJoCo's viewer opens: ``export_arena.py --arena A --out FILE.xml``."""

from pathlib import Path

from sarsim.arenas.export import write_mjcf
from sarsim.arenas.load import StartPose, load_arena
from sarsim.arenas.random_arena import RandomArenaConfig
from sarsim.scripts.cli import run

_DEFAULT = RandomArenaConfig()


def export_arena(
    arena: str, out: Path, start: StartPose | None = None, random: RandomArenaConfig = _DEFAULT
) -> None:
    """Write an arena without the robot; look at it with ``python -m mujoco.viewer --mjcf=FILE.xml``.

    Args:
        arena: a built-in one, random:SEED, or the path of a .raf or an MJCF file.
        out: the file to write; files that the arena's own MJCF refers to are copied beside it.
        start: where the robot is set down: x and y in m, yaw in degrees.
        random: what a random arena is like.
    """
    write_mjcf(load_arena(arena, start, random).mjcf_model, out)
    print(f"python -m mujoco.viewer --mjcf={out}")


def main() -> None:
    """Entry point."""
    run(export_arena)


if __name__ == "__main__":
    main()
