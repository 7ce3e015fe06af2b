"""Settings shared by all training runs; this module does not import PyTorch."""

from dataclasses import dataclass
from math import cos, pi

from pipeline.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """How AdamW's settings change: the learning rate rises linearly, then falls to 0 along half a cosine.

    Attributes:
        rise: share of the training during which the learning rate rises.
    """

    rise: float = 0.05

    def rate(self, progress: float, steps: int) -> float:
        """The learning rate of the step that ends at this progress, 0 to 1, as a share of the peak.

        Args:
            progress: share of the training that is completed after the step.
            steps: number of steps of the training.
        """
        if progress < self.rise:
            return progress / self.rise
        return (1 + cos(pi * (progress - self.rise) / (1 - self.rise))) / 2

    def momentum(self, progress: float, steps: int) -> float:
        """β₁ for that step; here PyTorch's default, 0.9."""
        return 0.9


@dataclass(frozen=True, kw_only=True)
class Optimization:
    """How training follows the gradients, and how often it saves its state.

    Attributes:
        schedule: schedule of the learning rate and β₁.
        weight_decay: AdamW's weight decay for all parameters except biases and batch norms; PyTorch's default.
        weight_decay_of_vectors: AdamW's weight decay for biases and batch norms.
        most_gradient: maximum norm, to which the gradient is clipped; None for no clipping.
        averaging: decay per step of a moving average of the weights, which is validated and written; None for none.
        save_every: steps between checkpoints, besides those at validations; a killed process loses no more steps.
    """

    schedule: Schedule = Schedule()
    weight_decay: float = 0.01
    weight_decay_of_vectors: float = 0.01
    most_gradient: float | None = None
    averaging: float | None = None
    save_every: int = 50


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """Settings of a training run.

    Attributes:
        steps: number of training steps, each on one batch; more steps fit the training data better but take longer.
        batch: samples per batch and worker; larger batches need more memory and give less noisy gradients.
        learning_rate: peak learning rate of AdamW; lower it if the loss jumps, raise it if the loss hardly falls.
        seed: seed of the initial weights, batches and augmentation; results with several seeds show how much depends
            on chance.
        minutes: limit of processor time in minutes, excluding validation. Training ends after this time or after
            --steps, whichever comes first, and the learning rate falls accordingly. Use it to compare networks whose
            steps differ in duration. By default no limit.
        validate_every: number of steps between validations; weights are written only after a validation.
        optimization: how it follows the gradients.
    """

    steps: int = 3000
    batch: int = 8
    learning_rate: float = 2e-3
    seed: int = 0
    minutes: float | None = None
    validate_every: int = 250
    optimization: Optimization = Optimization()

    def __post_init__(self) -> None:
        """Raise InputError for settings out of range."""
        if self.minutes is not None and not 0 < self.minutes < float("inf"):
            raise InputError(f"--minutes {self.minutes:g}: must be positive and finite")
        for flag, count in (("steps", self.steps), ("batch", self.batch), ("validate-every", self.validate_every)):
            if count < 1:
                raise InputError(f"--{flag} {count}: must be at least 1")
        if not 0 < self.learning_rate < float("inf"):
            raise InputError(f"--learning-rate {self.learning_rate:g}: must be positive and finite")
        if self.seed < 0:
            raise InputError(f"--seed {self.seed}: must be non-negative")


@dataclass(frozen=True, kw_only=True)
class BlockAugmentation:
    """How random blocks are cut and changed.

    Attributes:
        rare: share of the blocks that are cut around a point of a class drawn uniformly from the frame's classes; the
            others are cut around any point.
        jitter: standard deviation of the noise of every coordinate and of the height of the cloud, m, and of its roll
            and pitch about the camera, rad.
        dark: share of the clouds that are black; the others' colours are multiplied by a random factor of at most 1.
        thinnest: minimum share of a block's points that is kept; the share is drawn uniformly between this and 1.
    """

    rare: float = 0.5
    jitter: float = 0.003
    dark: float = 0.2
    thinnest: float = 0.5


@dataclass(frozen=True, kw_only=True)
class PointTrainingConfig(TrainingConfig):
    """Settings of a training of a network on points; the samples of a batch are blocks.

    Attributes:
        augmentation: how blocks are cut and changed.
    """

    augmentation: BlockAugmentation = BlockAugmentation()

    def __post_init__(self) -> None:
        """Raise InputError for settings out of range."""
        super().__post_init__()
        if self.batch < 2:
            raise InputError(f"--batch {self.batch}: must be at least 2, because batch norm needs several blocks")
