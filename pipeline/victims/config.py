"""The numbers by which people are detected in images, and set apart from what is behind them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ExposureConfig:
    """How uneven light is compensated.

    Attributes:
        columns, rows: of the grid whose cells are the surroundings.
        blur: cells, standard deviation of the Gaussian over the grid: dark objects stay dark, dark regions become
            bright.
        brightness: of 255, to which the brightest channel is raised where it is less.
        darkest: brightness, of 255, below which the gain grows no further: there is only noise.
    """

    columns: int = 16
    rows: int = 12
    blur: float = 2.0
    brightness: float = 130.0
    darkest: float = 12.0


@dataclass(frozen=True)
class DetectorConfig:
    """Which boxes of the network are detections.

    Attributes:
        confidence: least confidence of a detection; one this low only helps to find a victim again.
        suppressing_iou: intersection over union above which the less confident of two boxes is dropped.
        most_boxes: that are compared: a network that sees a person in every cell would otherwise take minutes an
            image.
        size: width and height of the image in the arena network, pixels, multiples of 32.
        near_size: of the image in it once more, for people who are so near that they are too large for the network.
        large_box: least length of the longer side of a box found in this one, relative to the image's longer side.
        hint: least confidence of a box that hints at a person, however faintly.
        most_hints: in an image of an arena; where there are more, the image is like none that the arena network has
            learned from. Of 485 frames of three arenas 1 % have more, of 116 photos of rooms and people all.
        witness: least confidence of a box of the COCO network that bears witness: so uncertain a network sees people
            in hardly any image without people, and where two networks see them by chance is not the same.
        witness_iou: overlap of the two boxes must be greater.
        view: side of the square in which the COCO network sees a candidate, pixels, a multiple of 32.
        context: side of this square in the image, relative to the candidate's longer side.
        lying: least width of a candidate, relative to its height, for it to be seen turned to either side too: photos
            teach few people who lie.
        exposure: how uneven light is compensated.
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
    """Which planes are in the background of a person.

    Attributes:
        samples: approximate number of pixels sampled from the box and its margin.
        trials: RANSAC's random draws for each plane.
        candidates: random samples of which the nearest in the image to a first sample is taken: planes are small, and
            far apart.
        least_share: of the samples that lie on a plane.
        beyond: least ratio of a plane's samples outside the box to those inside for it to be background.
        tolerance: m from a plane, in addition to the sensor's noise, within which a point belongs to it.
        sigmas: standard deviations of the sensor's noise.
        flat: least share of a plane's samples that lie nearly on it for it to be flatter than any person.
        flat_tolerance: m from the plane, in addition to one standard deviation, within which they lie nearly on it.
        flat_area: m² across the line of sight that they cover at least.
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
class VictimsConfig:
    """The numbers of the whole room; each part says its own."""

    detector: DetectorConfig = DetectorConfig()
    background: BackgroundConfig = BackgroundConfig()
