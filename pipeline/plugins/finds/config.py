"""Parameters of reading signs, codes and shapes in images."""

from dataclasses import dataclass

from pipeline.errors import InputError, require_at_least, require_positive
from pipeline.tracks.config import Confirmation, ObjectConfig


@dataclass(frozen=True)
class SquaresConfig:
    """Criteria for outlines in an image that may be squares.

    Attributes:
        max_pixels: maximum number of pixels in an image; larger images are shrunk, so that they take about as long
            as an image of 1600 × 1200 pixels.
        min_side: minimum side of a sign that can be recognised, pixels.
        small_window, window: sides of the square neighbourhoods with whose mean brightness or saturation a pixel is
            compared, pixels.
        contrast: offset of the thresholds below and above the mean, in levels from 0 to 255.
        saturation_offset: offset above the mean saturation beyond which a pixel is coloured, in levels from 0 to 255.
        hue_step: step from one colour mask to the next, 256ths of the circle of hues.
        hue_width: range of hues in a colour mask, 256ths of the circle.
        min_saturation: saturation, out of 255, above which a pixel has a hue.
        canny_low, canny_high: lower and upper threshold of the Canny edge detector, grey levels.
        tolerances: maximum errors of the polygon that approximates an outline, as fractions of the outline's length,
            tried in turn until the polygon has at most four corners.
        filled: minimum ratio of the smaller to the larger of two areas: the quadrilateral and its outline's hull.
        max_side_ratio: maximum ratio of two sides; the default corresponds to a square seen at 70° to its normal.
        oblong: ratio of two sides above which signs are expected side by side only along the longer side.
        same: difference between the centres and sizes of two outlines below which they are outlines of the same
            square, as a fraction of the diagonal.
        smallest, largest: minimum and maximum side of signs and codes, m, checked where the depth is known; the
            leagues' signs are up to 0.3 m wide.
    """

    max_pixels: int = 2_097_152
    min_side: int = 16
    small_window: int = 17
    window: int = 51
    contrast: int = 3
    saturation_offset: int = 16
    hue_step: int = 16
    hue_width: int = 32
    min_saturation: int = 64
    canny_low: int = 32
    canny_high: int = 96
    tolerances: tuple[float, ...] = (0.02, 0.04, 0.06)
    filled: float = 0.88
    max_side_ratio: float = 3.0
    oblong: float = 1.5
    same: float = 0.1
    smallest: float = 0.05
    largest: float = 0.5

    def __post_init__(self) -> None:
        require_positive("squares", self, "filled", "max_side_ratio", "oblong", "largest")
        require_at_least(1, "squares", self, "max_pixels", "min_side", "hue_step")
        require_at_least(0, "squares", self, "same", "smallest", "canny_low", "canny_high")
        for name in ("small_window", "window"):
            side = getattr(self, name)
            if side < 3 or side % 2 == 0:
                raise InputError(f"squares.{name} = {side}: must be odd and at least 3")
        _require_all_positive("squares.tolerances", self.tolerances)


@dataclass(frozen=True)
class HazmatConfig:
    """Criteria for squares that are hazmat signs.

    Attributes:
        confidence: minimum confidence of a sign, exclusive.
        prior_odds_ratio: odds of a sign among the training patches, divided by the odds of a sign among the squares
            of an image. The default was chosen with other weights, on the photos of boards and rooms on which the
            results are reported.
        alike: minimum intersection over union of squares that vote on a sign's class.
        sizes: scales of a square's outline over which probabilities are averaged, because outlines are inexact.
    """

    confidence: float = 0.5
    prior_odds_ratio: float = 9.0
    alike: float = 0.5
    sizes: tuple[float, ...] = (0.97, 1.0, 1.03)

    def __post_init__(self) -> None:
        require_positive("hazmat", self, "prior_odds_ratio")
        _require_all_positive("hazmat.sizes", self.sizes)


@dataclass(frozen=True)
class CodesConfig:
    """How QR codes are read.

    Attributes:
        checked_side: side of a rectified square that is checked for the modules of a code, pixels.
        changes: minimum sum of the changes from pixel to pixel along a row or column, in units of the whole grey
            range. Half of the 21 modules of the smallest code differ from the module before, so the default
            corresponds to 10 changes of 30%.
        read_side: side of a rectified square that is decoded, pixels; at least three per module up to version 10.
        min_area: minimum area of a code, square pixels.
        undecoded: confidence of a code that was located but not decoded; the robot views it from a shorter distance.
    """

    checked_side: int = 64
    changes: float = 3.0
    read_side: int = 256
    min_area: float = 1.0
    undecoded: float = 0.5

    def __post_init__(self) -> None:
        require_at_least(2, "codes", self, "checked_side", "read_side")
        require_at_least(0, "codes", self, "min_area")


@dataclass(frozen=True)
class ShapesConfig:
    """Criteria for extinguishers and levers.

    Attributes:
        stride: distance between the rows and columns that are searched, pixels.
        noise: minimum height by which a pixel stands out, standard deviations of the depth.
        hue: maximum difference from the hue of RAL 3000, the red that EN 3 requires, 256ths of the circle.
        min_saturation: saturation, out of 255, above which a pixel of such a hue is red.
        spreads: maximum deviation of the logarithm of an object's extent from its median, standard deviations; 97%
            of objects are less than two standard deviations above the median.
        confidence: minimum confidence of an object, exclusive.
    """

    stride: int = 2
    noise: float = 3.0
    hue: int = 16
    min_saturation: int = 127
    spreads: float = 2.0
    confidence: float = 0.5

    def __post_init__(self) -> None:
        require_positive("shapes", self, "spreads")
        require_at_least(1, "shapes", self, "stride")
        require_at_least(0, "shapes", self, "noise", "hue", "min_saturation")


def _require_all_positive(name: str, values: tuple[float, ...]) -> None:
    """Raise InputError unless there are ``values`` and all of them are greater than 0."""
    if not values or not min(values) > 0:
        raise InputError(f"{name} = {values}: must be at least one number, and all must be greater than 0")


SHAPE_CONFIRMATION = Confirmation(confidence=0.5, baseline=0.3)


@dataclass(frozen=True)
class FindsConfig:
    """Parameters of all readers, and of the tracks of each kind of find; see the classes of the fields.

    The extents of signs are those of the labels that the leagues print, 0.1 to 0.3 m. The extents of extinguishers
    are those in the RoboCup Rescue arena designer, and the extents of levers include their plates.
    """

    squares: SquaresConfig = SquaresConfig()
    hazmat: HazmatConfig = HazmatConfig()
    codes: CodesConfig = CodesConfig()
    shapes: ShapesConfig = ShapesConfig()
    hazmat_sign: ObjectConfig = ObjectConfig(is_flat=True, extents=((0.2, 0.2, 0.02),))
    qr_code: ObjectConfig = ObjectConfig(is_flat=True, has_checksum=True)
    april_tag: ObjectConfig = ObjectConfig(is_flat=True, has_checksum=True)
    fire_extinguisher: ObjectConfig = ObjectConfig(
        confirmation=SHAPE_CONFIRMATION, max_person_distance=0.15, extents=((0.45, 0.16, 0.14),)
    )
    door_lever: ObjectConfig = ObjectConfig(
        confirmation=SHAPE_CONFIRMATION, max_person_distance=0.15, extents=((0.22, 0.14, 0.06),)
    )

    def __post_init__(self) -> None:
        for name in ("fire_extinguisher", "door_lever"):
            if not getattr(self, name).extents:
                raise InputError(f"{name}.extents = (): must be at least one form, because regions are sought by it")

    @property
    def kinds(self) -> dict[str, ObjectConfig]:
        """The tracking parameters of each kind of find, by the name of the kind."""
        return {name: value for name, value in vars(self).items() if isinstance(value, ObjectConfig)}
