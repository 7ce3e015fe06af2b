"""Parameters of the detection of people in images, and of warm regions."""

from dataclasses import dataclass

from pipeline.errors import InputError, require_at_least, require_positive


@dataclass(frozen=True)
class DetectorConfig:
    """Limits that decide which of the networks' boxes are detections.

    Attributes:
        confidence: minimum confidence of a detection; at this confidence, a single detection does not confirm a
            person.
        suppressing_iou: intersection over union above which the less confident of two boxes is dropped.
        size: width and height of the shipped networks' input for a whole image, pixels, multiples of 32.
        max_hints: maximum number of hints of people in an image of an arena. An image with more hints is unlike the
            images on which the arena network was trained. Of 485 frames of three arenas, 1% have more; of 116 photos
            of rooms and people, all have more.
        min_corroboration: minimum confidence of a box of the COCO network that corroborates a candidate. Even with
            this low minimum, the network sees people in hardly any image without people, and two networks rarely make
            the same mistake.
    """

    confidence: float = 0.25
    suppressing_iou: float = 0.45
    size: tuple[int, int] = (512, 384)
    max_hints: int = 7
    min_corroboration: float = 0.05

    def __post_init__(self) -> None:
        for name in "confidence", "min_corroboration":
            if not 0 < (value := getattr(self, name)) < 1:
                raise InputError(f"victims.detector.{name} = {value:g}: must be greater than 0 and less than 1")
        require_at_least(0, "victims.detector", self, "suppressing_iou", "max_hints")
        if not all(side > 0 and side % 32 == 0 for side in self.size):
            raise InputError(f"victims.detector.size = {self.size}: must be two multiples of 32")


@dataclass(frozen=True)
class HeatConfig:
    """Limit that decides which regions are warm.

    Attributes:
        min_temperature_excess: minimum excess of a warm region's temperature over the median of the image, °C.
            Clothes on a living person are 6 to 8 °C warmer than the air in a room, and the noise of an uncooled
            camera is 0.05 °C.
    """

    min_temperature_excess: float = 5.0

    def __post_init__(self) -> None:
        require_positive("victims.heat", self, "min_temperature_excess")


@dataclass(frozen=True)
class VictimsConfig:
    """All parameters of the detection of people, one group per part."""

    detector: DetectorConfig = DetectorConfig()
    heat: HeatConfig = HeatConfig()
