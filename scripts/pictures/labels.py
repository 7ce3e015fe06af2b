"""Draw frames with labels: of the default network in semantic-labels.jpg, and of all networks in networks.jpg."""

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from pipeline.labels import COLOURS
from pipeline.semantic_map.networks.classifier import NetworkClassifier
from sarsim.settings import POINT_NETWORKS, WEIGHTS
from scripts.benchmarks.labelled_drives import PosedFrame, drive_through
from scripts.pictures.layout import save, scaled

FRAMES = {"nist_6x4": (1, 3, 4), "esogu_52x15": (1, 7, 15)}
"""Indices of the frames that are drawn from a drive, by arena."""
KEYFRAMES = (2.0, 0.8)  # m and rad, motion between frames


def label_picture(seen: PosedFrame, labels: NDArray[np.integer]) -> Rgb:
    """(H, W, 3) image of the labels (N,) of the returns, in their colours; black without return."""
    picture = np.zeros((*seen.frame.depth.shape, 3), np.uint8)
    picture[seen.frame.returns] = COLOURS[labels]
    return picture


def column(seen: PosedFrame, networks: list[NetworkClassifier]) -> Rgb:
    """The colour image, the true labels and the labels of each network, one above the other."""
    given = [network.classify(seen.frame, seen.points, seen.T_map_camera).argmax(axis=1) for network in networks]
    return np.vstack([seen.frame.rgb, *(label_picture(seen, labels) for labels in (seen.labels, *given))])


def draw_labels(name: str, networks: list[NetworkClassifier]) -> None:
    """Drive, take frames, and draw them with the labels of the networks."""
    columns = [
        column(seen, networks)
        for arena, wanted in FRAMES.items()
        for number, seen in enumerate(drive_through(arena, 1 + max(wanted), seed=0, keyframes=KEYFRAMES))
        if number in wanted
    ]
    save(name, scaled(np.hstack(columns), 0.4), 90)


def draw() -> None:
    """Draw the labels of the default network, without and with the vote, and of all networks without the vote."""
    draw_labels("semantic-labels.jpg", [NetworkClassifier(WEIGHTS, vote=False), NetworkClassifier(WEIGHTS)])
    draw_labels("networks.jpg", [NetworkClassifier(WEIGHTS.with_stem(name), vote=False) for name in POINT_NETWORKS])
