"""The classifier, detector and readers that a command's settings select; none of them needs a simulator."""

from collections.abc import Sequence
from pathlib import Path

from pipeline.errors import InputError
from pipeline.plugin import Plugin
from pipeline.semantic_map.classifier import PointClassifier, TruthClassifier
from pipeline.semantic_map.config import SemanticMapConfig
from pipeline.semantic_map.networks.classifier import NetworkClassifier
from pipeline.semantic_map.rules import RuleClassifier
from pipeline.victims.detection import Detector
from pipeline.victims.detector import VictimDetector
from pipeline.victims.readers import CombinedReaders, FindReader
from sarsim.assets import asset
from sarsim.methods.make import make_own
from sarsim.settings import POINT_NETWORKS, LabelSource, PerceptionConfig


def make_perception(config: PerceptionConfig) -> tuple[PointClassifier, Detector | None]:
    """The classifier and, if any, the victim detector of a command; InputError if one of them cannot be used."""
    classifier = make_classifier(config.labels, config.weights, config.pipeline.semantic_map)
    if config.detector_class:
        return classifier, make_own("detector-class", config.detector_class, Detector)
    numbers = config.pipeline.victims.detector
    if not config.detector:
        return classifier, None
    return classifier, VictimDetector.load(*config.detector, names=config.detector_names, config=numbers)


def make_readers(config: PerceptionConfig, plugins: Sequence[Plugin] = ()) -> FindReader | None:
    """The readers of all finds except people, readers from plug-ins first; None if there are no readers.

    Raises:
        InputError: a reader cannot be used.
    """
    readers = [reader for plugin in plugins for reader in plugin.readers()]
    readers += [make_own("reader", name, FindReader) for name in config.reader]
    return CombinedReaders(readers) if readers else None


def make_classifier(
    labels: LabelSource, weights: Path | None, config: SemanticMapConfig = SemanticMapConfig()
) -> PointClassifier:
    """The classifier that ``--labels`` names, with ``weights`` or the shipped weights.

    Raises:
        InputError: the weights are missing or belong to another network, or there is no classifier with this name.
    """
    if labels == "truth":
        return TruthClassifier()
    if labels == "rules":
        return RuleClassifier(config=config.rules)
    if labels not in POINT_NETWORKS:
        classifier: PointClassifier = make_own("labels", labels, PointClassifier)
        return classifier
    weights = weights or asset("weights", f"{labels}.safetensors")
    if not weights.exists():
        raise InputError(
            f"--weights {weights}: no such file; train the network with 'sarsim-train {labels}' "
            "or choose another source of labels with --labels"
        )
    return NetworkClassifier(weights, network=labels, config=config.network)
