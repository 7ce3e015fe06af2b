"""Draw labelled frames: semantic-labels.jpg with the default network and the vote, networks.jpg with all networks."""

import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.labels import COLOURS
from pipeline.semantic_map.networks.classifier import NetworkClassifier
from sarsim.settings import POINT_NETWORKS, WEIGHTS

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # scripts/ is not installed
from scripts.benchmarks.labelled_drives import PosedFrame, drive_through

FRAMES = {"nist_6x4": (1, 3, 4), "esogu_52x15": (1, 7, 15)}
"""For each arena, the indices of the frames of a drive that are drawn."""
KEYFRAMES = (2.0, 0.8)  # m and rad between frames


def label_picture(seen: PosedFrame, labels: NDArray[np.integer]) -> NDArray[np.uint8]:
    """(H, W, 3) BGR image of the labels (N,) of the returns, in their colours; black without return."""
    picture = np.zeros((*seen.frame.depth.shape, 3), np.uint8)
    picture[seen.frame.returns] = COLOURS[labels, ::-1]
    return picture


def column(seen: PosedFrame, networks: list[NetworkClassifier]) -> NDArray[np.uint8]:
    """Colour image, true labels and the labels of each network, one above the other."""
    given = [network.classify(seen.frame, seen.points, seen.T_map_camera).argmax(axis=1) for network in networks]
    colour = seen.frame.rgb[..., ::-1]
    return np.vstack([colour, *(label_picture(seen, labels) for labels in (seen.labels, *given))])


def draw(name: str, networks: list[NetworkClassifier]) -> None:
    """Drive, take frames, and draw them with the labels of the networks."""
    columns = [
        column(seen, networks)
        for arena, wanted in FRAMES.items()
        for number, seen in enumerate(drive_through(arena, 1 + max(wanted), seed=0, keyframes=KEYFRAMES))
        if number in wanted
    ]
    picture = cv2.resize(np.hstack(columns), None, fx=0.4, fy=0.4, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(Path(__file__).parents[1] / "images" / name), picture)


def main() -> None:
    """Draw the default network, without and with the vote, and all networks without it."""
    draw("semantic-labels.jpg", [NetworkClassifier(WEIGHTS, vote=False), NetworkClassifier(WEIGHTS)])
    draw("networks.jpg", [NetworkClassifier(WEIGHTS.with_stem(name), vote=False) for name in POINT_NETWORKS])


if __name__ == "__main__":
    main()
