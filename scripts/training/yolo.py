"""``train.py yolo``: the network that finds victims."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn

from pipeline.errors import InputError
from pipeline.victims.detection.training import Trainer, TrainingConfig
from sarsim.dataset.victim_images import VictimImages
from sarsim.scripts.cli import Interruptible


@dataclass(frozen=True)
class TrainYolo:
    """The network that finds victims, from datasets of generate_dataset.py.

    Attributes:
        data: their folders; scenes of the split train are learned from, those of val validated with.
        out: file for the weights (.weights); the network (.cfg), their card (.json), a table (.csv) and a checkpoint
            get its name with other endings. A training that was left is taken up from its checkpoint.
        stride: take every so manieth frame of a scene.
        init: weights to begin with, as this command writes them, their .cfg beside them: then its size counts, not
            --network, --width and --height; random ones if not given.
        training: settings.
    """

    data: tuple[Path, ...]
    out: Path
    stride: int = 1
    init: Path | None = None
    training: Annotated[TrainingConfig, tyro.conf.arg(name="")] = field(default_factory=TrainingConfig)

    def run(self) -> None:
        """Train, and say where the weights lie."""
        if self.stride < 1:
            raise InputError("--stride: at least 1")
        if self.out.suffix != ".weights":
            raise InputError(f"--out {self.out}: a name that ends with .weights")
        if not self.out.absolute().parent.is_dir():
            raise InputError(f"--out {self.out}: there is no folder {self.out.absolute().parent}")
        images = [VictimImages(self.data, split, self.stride) for split in ("train", "val")]
        try:
            about = {"data": list(map(str, self.data)), "images": [len(source) for source in images]}
            about |= {"stride": self.stride, "init": str(self.init) if self.init else None}
            trainer = Trainer(images[0], images[1], self.training, self.out, about, self.init)
            self._train(trainer)
        finally:
            for source in images:
                source.close()
        Console().print(f"Validated best: AP50 {trainer.best:.4f}. Weights in {self.out}", soft_wrap=True)

    def _train(self, trainer: Trainer) -> None:
        columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
        with Progress(*columns, console=Console(stderr=True)) as progress, Interruptible() as hold:
            bar = progress.add_task("steps", total=self.training.steps, completed=trainer.step)

            def report(now: Trainer) -> None:
                progress.update(bar, completed=now.step, description=f"steps, best {now.best:.3f}")
                if hold.interrupted:
                    raise KeyboardInterrupt

            trainer.run(report)
