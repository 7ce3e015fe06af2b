"""The classifier, detector and readers that a command's settings select; none of them needs a simulator."""

from pathlib import Path

from pipeline.errors import InputError
from pipeline.plugins.finds.readers import FindReaders
from pipeline.semantic_map.classifier import PointClassifier, TruthClassifier
from pipeline.semantic_map.config import SemanticMapConfig
from pipeline.semantic_map.networks.classifier import NetworkClassifier
from pipeline.semantic_map.rules import RuleClassifier
from pipeline.victims.detection.detection import Detector
from pipeline.victims.detection.detector import VictimDetector
from pipeline.victims.readers import FindReader, SeveralReaders
from sarsim.assets import asset
from sarsim.methods.make import make_own
from sarsim.settings import POINT_NETWORKS, Labels, PerceptionConfig


def make_perception(config: PerceptionConfig) -> tuple[PointClassifier, Detector | None]:
    """The classifier of a command and its victim detector, if any; InputError if they cannot be used."""
    classifier = make_classifier(config.labels, config.weights, config.pipeline.semantic_map)
    if config.detector_class:
        return classifier, make_own("detector-class", config.detector_class, Detector)
    numbers = config.pipeline.victims.detector
    return classifier, VictimDetector.load(*config.detector, config=numbers) if config.detector else None


def make_readers(config: PerceptionConfig) -> FindReader | None:
    """The readers of all finds except people, user-defined ones last; InputError if they cannot be used."""
    own = [make_own("reader", name, FindReader) for name in config.reader]
    shipped = shipped_readers(config)
    return SeveralReaders([*([shipped] if shipped else []), *own]) if own else shipped


def shipped_readers(config: PerceptionConfig) -> FindReaders | None:
    """The readers that sarsim ships, if there is a detector; InputError if their weights are damaged."""
    if not (config.detector or config.detector_class):
        return None
    hazmat, shapes = (asset("weights", f"{name}.safetensors") for name in ("hazmat", "shapes"))
    return FindReaders.load(hazmat, shapes, config.pipeline.finds, config.pipeline.tracks.likelihood)


def make_classifier(
    labels: Labels, weights: Path | None, config: SemanticMapConfig = SemanticMapConfig()
) -> PointClassifier:
    """The classifier that ``--labels`` names, with ``weights`` or the shipped ones.

    Raises:
        InputError: the weights are missing or belong to another network, or there is no such class.
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
