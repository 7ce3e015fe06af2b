"""Settings of the training of networks that label points; this module does not import PyTorch."""

from dataclasses import dataclass

from pipeline.errors import InputError


@dataclass(frozen=True, kw_only=True)
class BlockAugmentation:
    """How random blocks are cut and changed.

    Attributes:
        rare: fraction of the blocks that are cut around a point of a class drawn uniformly from the frame's classes;
            the others are cut around any point.
        jitter: standard deviation of the noise of every coordinate and of the height of the cloud, m, and of its roll
            and pitch about the camera, rad.
        dark: fraction of the clouds that are black; the others' colours are multiplied by a random factor up to 1.
        thinnest: minimum fraction of a block's points that is kept; the fraction is drawn uniformly between this
            minimum and 1.
    """

    rare: float = 0.5
    jitter: float = 0.003
    dark: float = 0.2
    thinnest: float = 0.5

    def __post_init__(self) -> None:
        """Raise InputError for settings out of range."""
        if not 0 <= self.jitter < float("inf"):
            raise InputError(f"augmentation.jitter = {self.jitter:g}: must be finite and at least 0")
        for name in ("rare", "dark", "thinnest"):
            if not 0 <= (fraction := getattr(self, name)) <= 1:
                raise InputError(f"augmentation.{name} = {fraction:g}: must be from 0 to 1")


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """Settings of a training run.

    Attributes:
        steps: number of training steps, each on one batch; more steps fit the training data better but take longer.
        batch: blocks per batch and worker; larger batches need more memory and give less noisy gradients.
        learning_rate: peak learning rate of AdamW; lower it if the loss jumps, raise it if the loss hardly falls.
        seed: seed of the initial weights, batches and augmentation; results with several seeds show how much depends
            on chance.
        minutes: limit of processor time in minutes, excluding validation. Training ends after this time or after
            --steps, whichever comes first, and the learning rate falls accordingly. Use this limit to compare
            networks whose steps differ in duration. By default, there is no limit.
        validate_every: number of steps between validations; weights are written only after a validation.
        augmentation: how blocks are cut and changed.
    """

    steps: int = 3000
    batch: int = 8
    learning_rate: float = 2e-3
    seed: int = 0
    minutes: float | None = None
    validate_every: int = 250
    augmentation: BlockAugmentation = BlockAugmentation()

    def __post_init__(self) -> None:
        """Raise InputError for settings out of range."""
        if self.minutes is not None and not 0 < self.minutes < float("inf"):
            raise InputError(f"--minutes {self.minutes:g}: must be positive and finite")
        for flag, count in (("steps", self.steps), ("validate-every", self.validate_every)):
            if count < 1:
                raise InputError(f"--{flag} {count}: must be at least 1")
        if self.batch < 2:
            raise InputError(f"--batch {self.batch}: must be at least 2, because batch norm needs several blocks")
        if not 0 < self.learning_rate < float("inf"):
            raise InputError(f"--learning-rate {self.learning_rate:g}: must be positive and finite")
        if self.seed < 0:
            raise InputError(f"--seed {self.seed}: must be non-negative")
