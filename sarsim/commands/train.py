"""Train a network that labels points: ``train.py NETWORK --data DIR --out FILE``.

To train a point network on several GPUs, or with one process per CPU core:
``torchrun --nproc-per-node N scripts/train.py ...``.
"""

from dataclasses import dataclass, field, fields
from functools import partial
from itertools import chain
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from tyro.conf import Fixed

from pipeline.errors import InputError
from pipeline.semantic_map.networks.training_config import BlockAugmentation, TrainingConfig
from sarsim.commands.cli import SignalRecorder, check_parent_folder, progress
from sarsim.commands.settings import run_subcommand, save_settings
from sarsim.flags import Given
from sarsim.settings import POINT_NETWORKS

if TYPE_CHECKING:
    from collections.abc import Callable

    from pipeline.semantic_map.networks.clouds import LabelledCloud
    from pipeline.semantic_map.networks.network import PointNetwork
    from pipeline.semantic_map.networks.training import Training, TrainingWorker

MAX_VALIDATION_CLOUDS = 40
"""Maximum number of validation clouds, spread over the scenes; with 200, validation took as long as 1,000 steps."""


@dataclass(frozen=True, kw_only=True)
class TrainPointsConfig(TrainingConfig):
    """Train a network of the semantic map on datasets made by sarsim-dataset.

    Attributes:
        data: folders of datasets. Training uses the scenes of the train split, validation those of the val split.
        out: file for the weights (.safetensors). A checkpoint, a table (.csv) and the settings (.yaml) are written
            next to it. To continue after an interruption, run the same command again.
        stride: use only every n-th frame of each scene; neighbouring frames look alike.
        init: file of initial weights, as written by sarsim-train. By default they are random.
        tensorboard: folder for TensorBoard events of loss and scores; TensorBoard must be installed.
        colours: learn from colours too, with nine channels instead of six. With --init, the initial weights decide.
    """

    data: tuple[Path, ...]
    out: Path
    stride: int = 1
    minutes: Given[float] = None
    init: Given[Path] = None
    tensorboard: Given[Path] = None
    colours: bool = False
    augmentation: Fixed[BlockAugmentation] = field(default_factory=BlockAugmentation)


def train_points(settings: TrainPointsConfig, network: str) -> None:
    """Train a network of the semantic map, and print the path of its weights."""
    if settings.stride < 1:
        raise InputError(f"--stride {settings.stride}: must be at least 1")
    if settings.out.suffix != ".safetensors":
        raise InputError(f"--out {settings.out}: the file name must end in .safetensors")
    check_parent_folder("out", settings.out)
    from pipeline.semantic_map.networks.blocks import COLOURED, BlockConfig
    from pipeline.semantic_map.networks.classifier import load_classifier
    from pipeline.semantic_map.networks.training import Training, TrainingWorker

    # Only the settings of the training itself, without the settings of its files.
    config = TrainingConfig(**{f.name: getattr(settings, f.name) for f in fields(TrainingConfig)})
    scenes = sum(map(_scenes, settings.data))
    about: dict[str, Any] = {"data": list(map(str, settings.data)), "scenes": scenes, "stride": settings.stride}
    initial: PointNetwork | str = network
    blocks = BlockConfig()
    colours = settings.colours
    if settings.init is not None:
        initial, blocks = load_classifier(settings.init, network)
        about["init"] = str(settings.init)
        colours = initial.channels == COLOURED
    worker = TrainingWorker.join()
    try:
        clouds = _clouds(settings, worker, blocks.voxel_size, colours)
        validation = clouds["val"][:: -(-len(clouds["val"]) // MAX_VALIDATION_CLOUDS)]
        training = Training(clouds["train"], validation, config, initial, settings.out, worker, blocks, about)
        _train(training, settings)
    finally:
        worker.leave()


def _scenes(data: Path) -> int:
    """The number of scenes of a dataset; InputError if a scene's file is missing."""
    from sarsim.dataset.manifest import Dataset

    scenes = [data / entry.file for entry in Dataset(data).entries]
    if missing := [path for path in scenes if not path.is_file()]:
        raise InputError(
            f"{missing[0]}: no such file (scenes missing: {len(missing)} of {len(scenes)});"
            " to generate them again, run sarsim-dataset with the original flags"
        )
    return len(scenes)


def _clouds(
    settings: TrainPointsConfig, worker: "TrainingWorker", voxel_size: float, colours: bool
) -> dict[str, list["LabelledCloud"]]:
    """Return the clouds of the train and val splits, and print the classes that are absent from the train split."""
    from pipeline.semantic_map.classifier import CLASSES
    from pipeline.semantic_map.networks.clouds import LabelledCloud
    from sarsim.dataset.manifest import Dataset

    datasets = [Dataset(folder) for folder in settings.data]
    clouds: dict[str, list[LabelledCloud]] = {"train": [], "val": [], "test": []}
    with progress(disable=not worker.is_leader) as bars:
        for entry, scene in bars.track(chain(*datasets), total=sum(map(len, datasets)), description="scenes"):
            for index in range(0, len(scene) if entry.split != "test" else 0, settings.stride):
                pose = scene.T_world_camera(index)
                clouds[entry.split].append(LabelledCloud.of(scene.frame(index), pose, voxel_size, colours))
    folders = " ".join(map(str, settings.data))
    if absent := [split for split in ("train", "val") if not clouds[split]]:
        raise InputError(f"--data {folders}: the {absent[0]} split has no scenes; generate at least 5 scenes")
    seen = sum(cloud.counts.sum(axis=0, dtype=int) for cloud in clouds["train"])
    missing = [label.name.lower() for label, count in zip(CLASSES, seen, strict=True) if not count]
    if missing and worker.is_leader:
        learned = "this label" if len(missing) == 1 else "these labels"
        warning = (
            f"--data {folders}: the train split has no points labelled {' or '.join(missing)},"
            f" so the network cannot learn {learned}"
        )
        Console(stderr=True, markup=False).print(warning, soft_wrap=True)
    return clouds


def _train(training: "Training", settings: TrainPointsConfig) -> None:
    """Train with a progress bar; Ctrl-C ends the training after the current step."""
    leads = training.worker.is_leader
    if leads:
        save_settings(settings, training.out.with_suffix(".yaml"))
    write_events = _event_writer(settings.tensorboard) if leads and settings.tensorboard else None
    with progress(disable=not leads) as bars, SignalRecorder() as hold:
        bar = bars.add_task("steps", total=training.config.steps, completed=training.step)

        def report(now: "Training") -> None:
            bars.update(bar, completed=now.step, description=f"steps{_score_text(now, ', ')}")
            if write_events:
                write_events(now)
            if hold.signal is not None:
                raise KeyboardInterrupt(hold.signal)

        training.run(report)
    if leads:
        Console(markup=False).print(
            f"Validation{_score_text(training, ': ') or ': none'}. Weights in {training.out}", soft_wrap=True
        )


def _score_text(training: "Training", before: str) -> str:
    """The last validation's score as text; empty without validation, or if it had no points of the four classes."""
    return f"{before}mIoU of the thesis's four classes {training.score:.4f}" if isfinite(training.score) else ""


def _event_writer(folder: Path) -> "Callable[[Training], None]":
    """A function that writes to TensorBoard all validations since the function was last called."""
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as error:
        raise InputError(
            f"--tensorboard {folder}: TensorBoard is not installed; run: pip install tensorboard"
        ) from error
    from pipeline.semantic_map.networks.training import SCORES

    writer = SummaryWriter(folder)
    written = 0

    def write(now: "Training") -> None:
        nonlocal written
        for step, *values in now.rows[written:]:
            for name, value in zip(("loss", *SCORES), values, strict=True):
                writer.add_scalar(name, value, int(step))
            writer.flush()
        written = len(now.rows)

    return write


def main() -> None:
    """Entry point of ``sarsim-train``."""
    networks: dict[str, Any] = {
        name: (partial(train_points, network=name), TrainPointsConfig) for name in POINT_NETWORKS
    }
    run_subcommand(networks, str(__doc__))
