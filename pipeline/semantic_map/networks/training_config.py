"""Settings of every training; they can be read without loading PyTorch."""

from dataclasses import dataclass

from pipeline.errors import InputError


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """Settings of a training.

    Attributes:
        steps: number of batches; more fit the training data better and take longer.
        batch: number of samples in a batch of each worker; larger batches take more memory and make steadier steps.
        learning_rate: highest learning rate of AdamW; lower it if the loss jumps, raise it if it hardly falls.
        seed: seed of the initial weights, the batches and their augmentation; other seeds show how much is chance.
        minutes: processor time, min, without validations, after which the training ends early; the learning rate then
            falls with the time. Use it to compare networks whose steps take different times.
        validate_every: number of steps between validations; each takes time, and weights are written only then.
    """

    steps: int = 3000
    batch: int = 8
    learning_rate: float = 2e-3
    seed: int = 0
    minutes: float | None = None
    validate_every: int = 250

    def __post_init__(self) -> None:
        """Raise InputError for settings out of range."""
        if self.minutes is not None and not 0 < self.minutes < float("inf"):
            raise InputError(f"--minutes {self.minutes:g}: more than 0")
        if min(self.steps, self.batch, self.validate_every) < 1:
            raise InputError("--steps, --batch, --validate-every: at least 1")
        if not 0 < self.learning_rate < float("inf") or self.seed < 0:
            raise InputError("--learning-rate: more than 0; --seed: at least 0")
