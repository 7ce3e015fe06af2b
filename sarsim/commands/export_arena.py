"""Write any arena as plain MJCF, which MuJoCo's viewer opens: ``export_arena.py --arena A --out FILE.xml``."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from tyro.conf import Fixed

from pipeline.errors import InputError
from pipeline.files import whole_file
from sarsim.arenas.settings import RandomArenaConfig, StartPose, WorldVictims
from sarsim.commands.cli import check_folder_of
from sarsim.commands.settings import run_with_settings


@dataclass(frozen=True)
class ExportArena:
    """What is written, and where.

    Attributes:
        arena: nist_6x4, esogu_52x15, lanes/NAME, random:SEED, the path of a .raf, MJCF, SDF or map file, or
            MODULE:FUNCTION of your own.
        out: MJCF file to write, .xml; files that the arena refers to are copied beside it.
        start: start pose: x and y in m, yaw in degrees; by default the arena's own.
        victims: list of victims and starts beside a world of others, as in run_episode.py.
        victims_state: state of victims whose names do not say it, as in run_episode.py.
        random: contents of a random arena, set in a --config file as run_episode.py writes it.
    """

    arena: str
    out: Path
    start: StartPose | None = None
    victims: Path | None = None
    victims_state: Literal["alive", "dead"] = "dead"
    random: Fixed[RandomArenaConfig] = field(default_factory=RandomArenaConfig)


def export_arena(settings: ExportArena) -> None:
    """Write an arena without the robot; view it with ``python -m mujoco.viewer --mjcf=FILE.xml``."""
    from sarsim.methods.arena import make_arena

    if settings.out.suffix != ".xml":  # by which MuJoCo knows its own files
        raise InputError(f"--out {settings.out}: MJCF is written, so the ending must be .xml")
    check_folder_of("out", settings.out)
    victims = WorldVictims(settings.victims, settings.victims_state)
    arena = make_arena(settings.arena, settings.start, settings.random, victims=victims)
    for name, content in (arena.mjcf_model.get_assets() | {settings.out.name: arena.to_xml().encode()}).items():
        with whole_file(settings.out.with_name(name)) as part:
            part.write_bytes(content)
    print(f"python -m mujoco.viewer --mjcf={settings.out}")


def main() -> None:
    """Entry point."""
    run_with_settings(export_arena, ExportArena)
