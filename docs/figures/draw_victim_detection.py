"""Draw the picture of victim-detection.md: ``python docs/figures/draw_victim_detection.py [CFG WEIGHTS]``."""

import sys
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.tracks.track import Observation
from pipeline.transforms import inverse, transform_points
from pipeline.victims.config import DetectorConfig
from pipeline.victims.detector import VictimDetector
from pipeline.victims.observation import observe
from sarsim.dataset.render import World, find_scene
from sarsim.sensors.lighting import Lighting
from sarsim.sensors.rendering import Renderer
from sarsim.settings import DETECTOR

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # scripts/ is not installed
from scripts.benchmarks.victims import recipe, with_lighting

IMAGE = Path(__file__).parents[1] / "images" / "victim-detections.jpg"
SEED, FRAMES, A_ROW, LEAST = 2026, 4, 3, 3000
"""Seed of the arenas; frames per arena; images per lighting; minimum number of pixels of people in an image."""
FOUND, REFUSED = (60, 220, 60), (255, 140, 0)
"""RGB of a box in which depth confirms a person, and of others; the pixels of confirmed people are tinted."""


def main() -> None:
    """Draw the detections of a detector, the shipped one if none is given, in each lighting."""
    detector = VictimDetector.load(*map(Path, sys.argv[1:3] or DETECTOR), config=DetectorConfig(confidence=0.5))
    rows = [np.hstack([picture(frame, detector) for frame in frames(light)]) for light in Lighting]
    cv2.imwrite(str(IMAGE), cv2.cvtColor(np.vstack(rows), cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 85])


def frames(light: Lighting) -> Iterator[Frame]:
    """From each of the first arenas that show people, the frame in which people cover the most pixels."""
    arenas, shown = with_lighting(recipe(SEED, FRAMES), light), 0
    for index in count():
        scene, arena = find_scene(arenas, index)
        with World(arena, scene, Renderer, arenas.width, arenas.height) as world:
            poses = world.drive(arenas, arenas.rng(index, "drive")).poses(FRAMES)
            noise = arenas.rng(index, "noise")
            captured = [world.capture(pose, noise) for pose in poses]
        best = max(captured, key=lambda frame: frame.victim_area.sum())
        if best.victim_area.sum() < LEAST:
            continue
        yield best.frame
        shown += 1
        if shown == A_ROW:
            return


def picture(frame: Frame, detector: VictimDetector) -> NDArray[np.uint8]:
    """(H, W, 3) the image with its detections, coloured by whether depth confirms a person."""
    result = frame.rgb.copy()
    for detection in detector.detect(frame.rgb):
        seen = observe(frame, detection, frame.T_base_camera)
        if isinstance(seen, Observation):
            tint(result, frame, seen.points)
        colour = FOUND if isinstance(seen, Observation) else REFUSED
        x0, y0, x1, y1 = (round(edge) for edge in detection.box)
        cv2.rectangle(result, (x0, y0), (x1, y1), colour, 2)
        text = f"{detection.confidence:.2f}" + ("" if isinstance(seen, Observation) else f" {seen.reason[:24]}")
        cv2.putText(result, text, (x0 + 4, max(y0 - 6, 18)), cv2.FONT_HERSHEY_SIMPLEX, 0.6, colour, 2)
    return np.asarray(cv2.resize(result, (480, 360), interpolation=cv2.INTER_AREA), np.uint8)


def tint(image: NDArray[np.uint8], frame: Frame, points: NDArray[np.float32]) -> None:
    """Tint the pixels of (N, 3) points, m in ``base_link``."""
    pixels, inside = frame.intrinsics.project(transform_points(inverse(frame.T_base_camera), points))
    v, u = pixels[inside].T
    image[v, u] = (0.6 * image[v, u] + 0.4 * np.array(FOUND)).astype(np.uint8)


if __name__ == "__main__":
    main()
