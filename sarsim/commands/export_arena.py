"""Write any arena as plain MJCF, which MuJoCo's viewer opens: ``export_arena.py --arena A --out FILE.xml``."""

import shlex
from dataclasses import dataclass, field
from pathlib import Path

from tyro.conf import Fixed

from pipeline.errors import InputError
from pipeline.files import atomic_write
from sarsim.arenas.settings import RandomArenaConfig, StartPose
from sarsim.commands.cli import check_parent_folder
from sarsim.commands.settings import run_with_settings
from sarsim.flags import Given
from sarsim.opengl import without_opengl


@dataclass(frozen=True)
class ExportArenaConfig:
    """The arena to export, and the file to write.

    Attributes:
        arena: nist_6x4, esogu_52x15, lanes/NAME or random:SEED; the path of a .raf, MJCF, SDF or map file; or your
            own MODULE:FUNCTION.
        out: MJCF file to write (.xml); the files that it refers to are copied to the same folder.
        start: start pose: x and y in m, yaw in degrees. By default the arena's own start.
        random: contents of a random arena, set in a --config file such as an episode's config.yaml.
    """

    arena: str
    out: Path
    start: Given[StartPose] = None
    random: Fixed[RandomArenaConfig] = field(default_factory=RandomArenaConfig)


def export_arena(settings: ExportArenaConfig) -> None:
    """Write an arena as MJCF, without the robot, and print how to view it."""
    with without_opengl():
        from sarsim.methods.arena import make_arena

    if settings.out.suffix != ".xml":  # the extension by which MuJoCo recognises MJCF
        raise InputError(f"--out {settings.out}: the file name must end in .xml")
    check_parent_folder("out", settings.out)
    arena = make_arena(settings.arena, settings.start, settings.random)
    assets = arena.mjcf_model.get_assets()
    for name, content in (assets | {settings.out.name: arena.to_xml().encode()}).items():
        with atomic_write(settings.out.with_name(name)) as part:
            part.write_bytes(content)
    count = len(assets)
    beside = f" and {count} file{'s' * (count > 1)} that it refers to" if count else ""
    viewer = f"python -m mujoco.viewer --mjcf={shlex.quote(str(settings.out))}"
    print(f"Exported {settings.arena} to {settings.out}{beside}; to view it: {viewer}")


def main() -> None:
    """Entry point of ``sarsim-export-arena``."""
    run_with_settings(export_arena, ExportArenaConfig)
