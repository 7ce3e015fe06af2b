"""Parameters of the detection of people in images, and of their separation from the background."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ExposureConfig:
    """How uneven lighting is compensated.

    Attributes:
        columns, rows: size of the coarse grid that holds the brightness of the surroundings.
        blur: standard deviation of the Gaussian that smooths the grid, cells: dark objects stay dark, dark regions
            are brightened.
        brightness: value, of 255, to which the brightest channel of the surroundings is raised if it is lower.
        darkest: brightness, of 255, below which the gain no longer increases, because there is only noise.
    """

    columns: int = 16
    rows: int = 12
    blur: float = 2.0
    brightness: float = 130.0
    darkest: float = 12.0


@dataclass(frozen=True)
class DetectorConfig:
    """Which of the networks' boxes are detections.

    Attributes:
        confidence: minimum confidence of a detection; one this low counts only together with others.
        suppressing_iou: intersection over union above which the less confident of two boxes is dropped.
        most_boxes: maximum number of boxes that are compared: a network that sees a person in every cell would
            otherwise take minutes per image.
        size: width and height of a network's input for a whole image, pixels, multiples of 32.
        near_size: the same for a second, smaller input, for people so near that they are too large in the first one.
        large_box: minimum longer side of a box found in the second input, relative to the image's longer side.
        hint: minimum confidence of a box that counts as a hint of a person.
        most_hints: maximum number of hints in an image of an arena. An image with more is unlike those that the arena
            network was trained on. Of 485 frames of three arenas, 1 % have more; of 116 photos of rooms and people,
            all have more.
        witness: minimum confidence of a box of the COCO network that corroborates a suspect. Even this low, it sees
            people in hardly any image without people, and two networks rarely err at the same place.
        witness_iou: intersection over union of the two boxes must be greater.
        view: side of the COCO network's square input for a suspect, pixels, a multiple of 32.
        context: side of the square that it shows, relative to the suspect's longer side.
        lying: minimum width of a suspect, relative to its height, for the square to be rotated by 90° either way too:
            photos show few people lying down.
        exposure: how uneven lighting is compensated.
    """

    confidence: float = 0.25
    suppressing_iou: float = 0.45
    most_boxes: int = 3000
    size: tuple[int, int] = (512, 384)
    near_size: tuple[int, int] = (224, 160)
    large_box: float = 0.15
    hint: float = 0.02
    most_hints: int = 7
    witness: float = 0.05
    witness_iou: float = 0.3
    view: int = 128
    context: float = 1.25
    lying: float = 0.8
    exposure: ExposureConfig = ExposureConfig()


@dataclass(frozen=True)
class BackgroundConfig:
    """Which planes belong to the background of a person.

    Attributes:
        samples: approximate number of pixels sampled from the box and its margin.
        trials: number of point triples that RANSAC draws for each plane.
        candidates: number of random samples from which each further point of a triple is chosen, as the nearest to
            its first point in the image: planes are small and far apart.
        least_share: minimum share of all samples that must lie on a plane.
        beyond: minimum ratio of a plane's samples outside the box to those inside for it to be background.
        tolerance: maximum distance of a point from its plane, in addition to the sensor's noise, m.
        sigmas: number of standard deviations of the sensor's noise that is added.
        flat: minimum share of a plane's samples within ``flat_tolerance`` for it to be flatter than any person.
        flat_tolerance: maximum distance of these samples, in addition to one standard deviation of the noise, m.
        flat_area: minimum area of the plane's samples across the line of sight, m².
    """

    samples: int = 3000
    trials: int = 200
    candidates: int = 12
    least_share: float = 0.02
    beyond: float = 0.25
    tolerance: float = 0.012
    sigmas: float = 2.0
    flat: float = 0.6
    flat_tolerance: float = 0.002
    flat_area: float = 0.04


@dataclass(frozen=True)
class HeatConfig:
    """Which regions are warm.

    Attributes:
        warmer: minimum temperature above the median of the image, °C: clothes on a living person are 6 to 8 °C warmer
            than the air in a room, and the noise of an uncooled camera is 0.05 °C.
        least_outline: minimum number of pixels on the outline of a warm region; fewer may be a lamp or a hot pixel.
    """

    warmer: float = 5.0
    least_outline: int = 4


@dataclass(frozen=True)
class VictimsConfig:
    """All parameters of this package; the parts document their own."""

    detector: DetectorConfig = DetectorConfig()
    background: BackgroundConfig = BackgroundConfig()
    heat: HeatConfig = HeatConfig()
