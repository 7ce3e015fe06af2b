"""Draw the picture for victim-detection.md: the detections of the shipped detector in each lighting."""

from collections.abc import Iterator
from itertools import count

import cv2
import numpy as np

from pipeline.arrays import Points, Rgb
from pipeline.frame import Frame
from pipeline.lettering import width_of, write
from pipeline.tracks.track import Observation
from pipeline.transforms import inverse, transform_points
from pipeline.victims.config import DetectorConfig
from pipeline.victims.detector import VictimDetector
from pipeline.victims.observation import observe
from sarsim.dataset.render import World, find_scene
from sarsim.sensors.lighting import Lighting
from sarsim.sensors.rendering import Renderer
from sarsim.settings import DEFAULT_DETECTOR
from scripts.benchmarks.victims import recipe, with_lighting
from scripts.pictures.layout import beside, save, scaled, stacked

FACTOR, LETTER_HEIGHT = 0.75, 15
"""Factor by which images are scaled down, and height of letters, pixels."""
SEED, FRAMES, IMAGES_PER_LIGHTING, MIN_PERSON_PIXELS = 2026, 4, 3, 3000
"""Seed of the arenas; frames per arena; images per lighting; minimum number of pixels of people in an image."""
FOUND, REFUSED = (60, 220, 60), (255, 140, 0)
"""RGB colours of boxes in which depth confirms a person, and of other boxes; confirmed people are tinted."""


def draw() -> None:
    """Draw the detections in each lighting."""
    detector = VictimDetector.load(*DEFAULT_DETECTOR, config=DetectorConfig(confidence=0.5))
    rows = (beside(*(picture(frame, detector) for frame in frames(light)), gap=4) for light in Lighting)
    save("victim-detections.jpg", stacked(*rows, gap=4))


def frames(light: Lighting) -> Iterator[Frame]:
    """Yield, from each of the first arenas that show people, the frame in which people cover the most pixels."""
    arenas, shown = with_lighting(recipe(SEED, FRAMES), light), 0
    for index in count():
        scene, arena = find_scene(arenas, index)
        with World(arena, scene, Renderer, arenas.width, arenas.height) as world:
            poses = world.drive(arenas, arenas.rng(index, "drive")).poses(FRAMES)
            noise = arenas.rng(index, "noise")
            captured = [world.capture(pose, noise) for pose in poses]
        best = max(captured, key=lambda frame: frame.victim_area.sum())
        if best.victim_area.sum() < MIN_PERSON_PIXELS:
            continue
        yield best.frame
        shown += 1
        if shown == IMAGES_PER_LIGHTING:
            return


def picture(frame: Frame, detector: VictimDetector) -> Rgb:
    """(H, W, 3) image of a frame with its detections, coloured by whether depth confirms a person."""
    result, texts = frame.rgb.copy(), []
    for detection in detector.detect(frame.rgb):
        seen = observe(frame, detection, frame.T_base_camera)
        if isinstance(seen, Observation):
            tint(result, frame, seen.points)
        colour = FOUND if isinstance(seen, Observation) else REFUSED
        x0, y0, x1, y1 = (round(edge) for edge in detection.box)
        cv2.rectangle(result, (x0, y0), (x1, y1), colour, 2)
        text = f"{detection.confidence:.2f}" + ("" if isinstance(seen, Observation) else f" {seen.reason}")
        texts.append((FACTOR * x0, FACTOR * y0, text, colour))
    result = scaled(result, FACTOR)
    for x, y, text, colour in texts:  # Text is written on the scaled image, so that letters stay sharp
        left = min(round(x), result.shape[1] - width_of(text, LETTER_HEIGHT) - 4)
        write(result, (left, max(round(y) - 5, LETTER_HEIGHT)), text, LETTER_HEIGHT, colour)
    return result


def tint(image: Rgb, frame: Frame, points: Points) -> None:
    """Tint the pixels of (N, 3) points, m in ``base_link``."""
    pixels, inside = frame.intrinsics.project(transform_points(inverse(frame.T_base_camera), points))
    v, u = pixels[inside].T
    image[v, u] = (0.6 * image[v, u] + 0.4 * np.array(FOUND)).astype(np.uint8)
