"""Train one of the robot's networks: ``train.py NETWORK --data DIR --out FILE``.

On several GPUs, or a process for each core of a CPU: ``torchrun --nproc-per-node N scripts/train.py ...``.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn

from pipeline.errors import InputError
from pipeline.semantic_map.networks.blocks import BlockConfig
from pipeline.semantic_map.networks.classifier import load_classifier
from pipeline.semantic_map.networks.clouds import LabelledCloud
from pipeline.semantic_map.networks.parallel import Worker
from pipeline.semantic_map.networks.training import Trainer, TrainingConfig
from sarsim.dataset.folder import Dataset
from sarsim.scripts.cli import guarded, parse
from sarsim.scripts.training.yolo import TrainYolo


@dataclass(frozen=True)
class TrainDgcnn:
    """The network of the semantic map, from a dataset of generate_dataset.py.

    Attributes:
        data: folder of the dataset; its scenes of the split train are learned from, those of val validated with.
        out: file for the weights (.safetensors); a checkpoint and a table (.csv) get its name with other endings.
            A training that was left is taken up from its checkpoint.
        stride: take every so manieth frame of a scene.
        validation_frames: at most, evenly over the scenes.
        init: weights to begin with, as this command writes them; random ones if not given.
        until: leave the training after that step; the same command takes it up again.
        training: settings.
    """

    data: Path
    out: Path
    stride: int = 1
    validation_frames: int = 200
    init: Path | None = None
    until: int | None = None
    training: Annotated[TrainingConfig, tyro.conf.arg(name="")] = field(default_factory=TrainingConfig)

    def run(self) -> None:
        """Train, and say where the weights lie."""
        self._check()
        initial = None if self.init is None else load_classifier(self.init)[0]
        worker = Worker.join()
        try:
            clouds = self._load(worker)
            validation = clouds["val"][:: 1 + len(clouds["val"]) // self.validation_frames]
            about = {"data": str(self.data), "scenes": len(Dataset(self.data)), "stride": self.stride}
            about |= {} if self.init is None else {"init": str(self.init)}
            trainer = Trainer(clouds["train"], validation, self.training, self.out, worker, about, initial)
            self._train(trainer)
        finally:
            worker.leave()
        if worker.leads:
            told = f"Validated best: mIoU over the four {trainer.best:.4f}. Weights in {self.out}"
            Console().print(told, soft_wrap=True)

    def _check(self) -> None:
        if self.stride < 1 or self.validation_frames < 1:
            raise InputError("--stride, --validation-frames: at least 1")
        if not self.out.absolute().parent.is_dir():
            raise InputError(f"--out {self.out}: there is no folder {self.out.absolute().parent}")
        scenes = [self.data / entry.file for entry in Dataset(self.data).entries]
        if missing := [path for path in scenes if not path.is_file()]:
            raise InputError(
                f"{missing[0]}: missing, {len(missing)} of {len(scenes)} scenes are:"
                " generate_dataset.py with the flags of before makes them again"
            )

    def _load(self, worker: Worker) -> dict[str, list[LabelledCloud]]:
        """The clouds of every split."""
        dataset, voxel_size = Dataset(self.data), BlockConfig().voxel_size
        clouds: dict[str, list[LabelledCloud]] = {"train": [], "val": [], "test": []}
        with progress_bar(worker) as progress:
            for entry, scene in progress.track(dataset, total=len(dataset), description="scenes"):
                for index in range(0, len(scene) if entry.split != "test" else 0, self.stride):
                    pose = scene.T_world_camera(index)
                    clouds[entry.split].append(LabelledCloud.of(scene.frame(index), pose, voxel_size))
        if not clouds["val"]:
            raise InputError(
                f"--data {self.data}: no scene of the split val, which one in ten is: make 5 at least"
            )
        return clouds

    def _train(self, trainer: Trainer) -> None:
        with progress_bar(trainer.worker) as progress:
            bar = progress.add_task("steps", total=self.training.steps, completed=trainer.step)
            trainer.run(
                lambda now: progress.update(
                    bar, completed=now.step, description=f"steps, best {now.best:.3f}"
                ),
                self.until,
            )


def progress_bar(worker: Worker) -> Progress:
    """Shown by one worker alone."""
    columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, console=Console(stderr=True), disable=not worker.leads)


NETWORKS: dict[str, Callable[..., TrainDgcnn | TrainYolo]] = {"dgcnn": TrainDgcnn, "yolo": TrainYolo}


def train() -> None:
    """Parse the command line and train."""
    network = parse(lambda: tyro.extras.subcommand_cli_from_dict(NETWORKS, description=__doc__))
    network.run()


def main() -> None:
    """Entry point."""
    guarded(train)


if __name__ == "__main__":
    main()
