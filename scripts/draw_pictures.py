"""Draw the pictures for the README and the documentation: ``draw_pictures.py [PICTURE ...]``."""

import sys
from importlib import import_module
from pathlib import Path
from typing import Annotated

try:
    import tyro
except ModuleNotFoundError as error:
    raise SystemExit(
        f"error: {error.name} is not installed; run: make develop && source .venv/bin/activate"
    ) from None

from pipeline.errors import InputError
from sarsim.commands.cli import run

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # scripts/ is not installed
RUN, MISSION, PHOTOS = "runs/results/episode", "runs/mission", "runs/real_frames"
RESULTS = "runs/results"
FOLDER_PICTURES = {
    "animation": RUN,
    "recording": RUN,
    "rescue_report": RUN,
    "semantic_map": RUN,
    "metric_map": RUN,
    "topological_map": RUN,
    "thumbnails": RUN,  # Last, because thumbnails are cut out of the other pictures
    "mission": MISSION,
    "real_frames": PHOTOS,
    "explored": RESULTS,
}
"""Pictures that show the files in a folder of the repository."""
ORIGINS = {
    RUN: "make results PAGE=episode leaves it there",
    MISSION: "run a mission with --out runs/mission, as docs/missions.md says",
    RESULTS: "make results PAGE=exploration FOLDER=... leaves it there",
    PHOTOS: "put Open3D's test images of SUN RGB-D, NYU Depth v2 and TUM RGB-D there",
}
"""Instructions for obtaining each of these folders."""
CODE_PICTURES = (
    *("arenas", "badges", "camera", "esogu", "labels", "lanes"),
    *("lidar", "lighting", "notebook", "victim_detection"),
)
"""Pictures that show the simulator and the networks."""


def draw_pictures(pictures: Annotated[tuple[str, ...], tyro.conf.Positional] = ()) -> None:
    """Redraw pictures for the README and the documentation.

    Args:
        pictures: names of modules in scripts/pictures. By default all pictures of the run measured by make results.
    """
    known = (*FOLDER_PICTURES, *CODE_PICTURES)
    if unknown := set(pictures) - set(known):
        raise InputError(f"{', '.join(sorted(unknown))}: no such picture; use {', '.join(known)}")
    names = pictures or [name for name, folder in FOLDER_PICTURES.items() if folder == RUN]
    shown = {name: [ROOT / FOLDER_PICTURES[name]] if name in FOLDER_PICTURES else [] for name in names}
    for folder in {FOLDER_PICTURES[name] for name in names if name in FOLDER_PICTURES}:
        if not (ROOT / folder).is_dir():
            raise InputError(f"{folder}: no such folder; {ORIGINS[folder]}")
    for name, arguments in shown.items():
        import_module(f"scripts.pictures.{name}").draw(*arguments)


def main() -> None:
    """Entry point."""
    run(draw_pictures)


if __name__ == "__main__":
    main()
