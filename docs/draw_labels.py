"""Draw docs/semantic-labels.jpg: what the robot sees, the true labels, and those that the network gives."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.labels import COLOURS
from pipeline.semantic_map.dgcnn.classifier import DgcnnClassifier
from sarsim.assets import asset
from sarsim.scripts.benchmarks.labelled_drives import TrueFrame, drive_through

FRAMES = {"nist_6x4": (4, 17, 33), "esogu_52x15": (6, 20, 36)}
"""By arena, which frames of a drive."""


def label_picture(seen: TrueFrame, labels: NDArray[np.integer]) -> NDArray[np.uint8]:
    """(H, W, 3) BGR, the (N,) labels of the returns in their colours; no return is black."""
    picture = np.zeros((*seen.frame.depth.shape, 3), np.uint8)
    picture[seen.frame.returns] = COLOURS[labels, ::-1]
    return picture


def column(seen: TrueFrame, network: DgcnnClassifier) -> NDArray[np.uint8]:
    """Colour, true labels and given ones, one above the other."""
    given = network.classify(seen.frame, seen.points).argmax(axis=1)
    colour = seen.frame.rgb[..., ::-1]
    return np.vstack([colour, label_picture(seen, seen.labels), label_picture(seen, given)])


def main() -> None:
    """Drive, look, draw."""
    network = DgcnnClassifier(asset("weights", "dgcnn.safetensors"))
    columns = [
        column(seen, network)
        for arena, wanted in FRAMES.items()
        for number, seen in enumerate(drive_through(arena, 1 + max(wanted), seed=0))
        if number in wanted
    ]
    picture = cv2.resize(np.hstack(columns), None, fx=0.4, fy=0.4, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(Path(__file__).with_name("semantic-labels.jpg")), picture)


if __name__ == "__main__":
    main()
