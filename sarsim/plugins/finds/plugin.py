"""Signs, codes and shapes as a plug-in: their readers and, in a simulation, their score."""

from collections.abc import Sequence

from pipeline.plugin import Plugin, RunContext
from pipeline.plugins.finds.config import FindsConfig
from pipeline.plugins.finds.readers import FindReaders
from pipeline.sink import Sink
from sarsim.assets import asset


class Finds(Plugin):
    """Reads and scores the objects besides people that a rescue robot looks for."""

    Settings = FindsConfig

    def readers(self) -> Sequence[FindReaders]:
        """The readers, with the shipped weights; InputError if these are damaged."""
        return [shipped_readers(self.settings)]

    def sinks(self, context: RunContext) -> Sequence[Sink]:
        """The sink that scores the finds; none if the robot is not simulated."""
        if context.world is None:
            return []
        from sarsim.plugins.finds.score import FindScore  # imported here, because recordings need no simulator

        return [FindScore(context.world, context.mapper)]


def shipped_readers(config: FindsConfig = FindsConfig()) -> FindReaders:
    """The readers with the weights that sarsim ships; InputError if these are damaged."""
    hazmat, shapes = (asset("weights", f"{name}.safetensors") for name in ("hazmat", "shapes"))
    return FindReaders.load(hazmat, shapes, config)
