"""Settings of every training; they can be read without loading PyTorch."""

from dataclasses import dataclass
from math import cos, pi

from pipeline.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """How AdamW's settings change in a training: the learning rate rises in a line, then falls to 0 as half a cosine.

    Attributes:
        rise: share of the training in which the learning rate rises.
    """

    rise: float = 0.05

    def rate(self, progress: float, steps: int) -> float:
        """The learning rate, as a share of the highest, of the step that ends at a progress of 0 to 1.

        Args:
            progress: share of the training that is done after the step.
            steps: number of steps of the training.
        """
        if progress < self.rise:
            return progress / self.rise
        return (1 + cos(pi * (progress - self.rise) / (1 - self.rise))) / 2

    def momentum(self, progress: float, steps: int) -> float:
        """β₁ of that step, by default PyTorch's 0.9."""
        return 0.9


@dataclass(frozen=True, kw_only=True)
class Optimization:
    """How a training follows the gradients.

    Attributes:
        schedule: of the learning rate and β₁.
        weight_decay: AdamW's for all weights but the next; PyTorch's default.
        weight_decay_of_vectors: AdamW's for biases and batch norms.
        most_gradient: norm to which a gradient is shortened; None leaves it as it is.
        averaging: decay per step of a moving average of the weights, which is then validated and written.
        save_every: steps between checkpoints, apart from those at validations: a killed process loses no more steps.
    """

    schedule: Schedule = Schedule()
    weight_decay: float = 0.01
    weight_decay_of_vectors: float = 0.01
    most_gradient: float | None = None
    averaging: float | None = None
    save_every: int = 50


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """Settings of a training.

    Attributes:
        steps: number of batches; more batches fit the training data better but take longer.
        batch: samples per batch and worker; larger batches need more memory and give steadier steps.
        learning_rate: peak learning rate of AdamW; lower it if the loss jumps, raise it if it hardly falls.
        seed: seed of the initial weights, batches and augmentation; compare seeds to see how much is chance.
        minutes: processor time, min, after which training ends, validation excluded; the learning rate then follows
            the time. Use it to compare networks whose steps differ in duration.
        validate_every: steps between validations; weights are written only after a validation.
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
            raise InputError(f"--minutes {self.minutes:g}: must be positive")
        if min(self.steps, self.batch, self.validate_every) < 1:
            raise InputError("--steps, --batch and --validate-every must be at least 1")
        if not 0 < self.learning_rate < float("inf") or self.seed < 0:
            raise InputError("--learning-rate must be positive, and --seed must not be negative")


@dataclass(frozen=True, kw_only=True)
class BlockAugmentation:
    """How random blocks are cut and changed.

    Attributes:
        rare: share of the blocks that are cut around a point of a class drawn evenly from the frame's classes; the
            others are cut around any point.
        jitter: m, standard deviation of the noise of every coordinate and of the height of the whole cloud; rad, that
            of its roll and pitch about the camera.
        dark: share of the clouds that are black; the others' colours are multiplied by a random factor of at most 1.
        thinnest: the share of a block's points that is kept is drawn uniformly between this and 1.
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
            raise InputError(f"--batch {self.batch}: must be at least 2, for batch norm over blocks")
