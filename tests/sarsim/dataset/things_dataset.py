"""A dataset of one frame with things to find on a wall."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from sarsim.dataset.manifest import Manifest, SceneEntry, scene_path, split_of
from sarsim.dataset.scene_file import SceneFrame, SceneWriter
from tests.pipeline.finds.wall_of_things import wall_of
from tests.sarsim.dataset.small import RECIPE, content


def write_things_dataset(folder: Path, *things: str) -> None:
    """The frame shows these things and a block."""
    frame, geoms = wall_of(*things)
    count = len(geoms)
    about = replace(
        content(0), intrinsics=frame.intrinsics, geom_name=geoms, geom_label=np.full(count, 7, np.uint8),
        geom_victim=np.full(count, -1, np.int16),
    )  # fmt: skip
    (folder / "scenes").mkdir(parents=True)
    with SceneWriter(folder / scene_path(0), 1, about) as writer:
        writer.write(SceneFrame(frame, np.eye(4), np.zeros((0, 4), np.int32), np.zeros(0, np.int32)))
    manifest = Manifest.new(RECIPE)
    manifest.scenes[0] = SceneEntry(0, scene_path(0), split_of(0), "", 1, "toy", "dim", {})
    manifest.write(folder)
