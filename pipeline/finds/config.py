"""The numbers by which signs, codes, shapes and heat are read in images."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SquaresConfig:
    """What may be a square in an image.

    Attributes:
        most_pixels: of an image; a larger one is made smaller, so that it takes no longer than 1600 × 1200.
        least_side: pixels along a side from which a sign may be recognised.
        small_window, window: pixels along the surroundings with whose mean brightness or saturation a pixel is
            compared.
        contrast: levels of 256 by which a pixel must differ from the mean.
        more_coloured: levels of 256 by which it must be more saturated than the mean to be coloured.
        hues: 256ths of the circle of hues from one mask of a colour to the next.
        hue_width: 256ths of the circle that such a mask spans.
        coloured: saturation, of 255, above which a pixel has a hue.
        faint_edge, sure_edge: grey levels, the lower and the upper threshold of Canny's edges.
        tolerances: shares of an outline's length by which a polygon may be off, tried until it has four corners.
        filled: least share of a quadrilateral that its outline's hull fills, and of the hull's own area.
        aslant: largest ratio of two sides: that of a square seen at 70° from ahead.
        oblong: ratio of two sides from which on signs may hang side by side along the longer one alone.
        same: share of a diagonal by which corners of the same square may differ.
        smallest, largest: m along a side of signs and codes, where the depth is known: the leagues' signs are
            0.3 m wide.
    """

    most_pixels: int = 2_097_152
    least_side: int = 16
    small_window: int = 17
    window: int = 51
    contrast: int = 3
    more_coloured: int = 16
    hues: int = 16
    hue_width: int = 32
    coloured: int = 64
    faint_edge: int = 32
    sure_edge: int = 96
    tolerances: tuple[float, ...] = (0.02, 0.04, 0.06)
    filled: float = 0.88
    aslant: float = 3.0
    oblong: float = 1.5
    same: float = 0.1
    smallest: float = 0.05
    largest: float = 0.5


@dataclass(frozen=True)
class HazmatConfig:
    """When a square is a hazmat sign.

    Attributes:
        confidence: a sign is surer than this.
        rarer: odds of a sign among the patches that were learned, over those among the squares of a camera's image:
            chosen by the photos of boards and rooms on which its figures are given, for earlier weights.
        alike: least intersection over union of squares that vote on a sign's class.
        sizes: of a square over its outline's, all of which vote: outlines are a little off.
    """

    confidence: float = 0.5
    rarer: float = 9.0
    alike: float = 0.5
    sizes: tuple[float, ...] = (0.97, 1.0, 1.03)


@dataclass(frozen=True)
class CodesConfig:
    """How QR codes are read.

    Attributes:
        checked_side: pixels along a rectified square in which the modules of a code are looked for.
        changes: times the whole range of grey by which the pixels of a row or column must change in sum. Of the 21
            modules of the smallest code half differ from the one before: 10 changes by 30 % of the range.
        read_side: pixels along a rectified square that is decoded: three and more a module up to version 10.
        least_area: square pixels; a smaller quadrilateral is no code.
        undecoded: confidence of a code that was located but not decoded; it is looked at from nearer.
    """

    checked_side: int = 64
    changes: float = 3.0
    read_side: int = 256
    least_area: float = 1.0
    undecoded: float = 0.5


@dataclass(frozen=True)
class ShapesConfig:
    """What may be an extinguisher or a lever.

    Attributes:
        stride: distance between the rows and columns that are searched, pixels.
        noise: standard deviations of the depth by which a pixel must stand out.
        hue: 256ths of the circle of hues around the red of RAL 3000, as EN 3 asks for.
        coloured: saturation, of 255, above which a pixel has that red.
        spreads: standard deviations of an extent's logarithm about its median up to which it is looked for: 97 % of
            the objects are smaller than two above it.
        confidence: an object is surer than this.
    """

    stride: int = 2
    noise: float = 3.0
    hue: int = 16
    coloured: int = 127
    spreads: float = 2.0
    confidence: float = 0.5


@dataclass(frozen=True)
class HeatConfig:
    """What is warm.

    Attributes:
        warmer: °C above the median of the image: clothes on a living person are 6 to 8 °C above the air of a room,
            and the noise of an uncooled camera is 0.05 °C.
        least_outline: pixels along the outline of a warm region; fewer may be a lamp or a hot spot of the sensor.
    """

    warmer: float = 5.0
    least_outline: int = 4


@dataclass(frozen=True)
class FindsConfig:
    """The numbers of all readers; each part says its own."""

    squares: SquaresConfig = SquaresConfig()
    hazmat: HazmatConfig = HazmatConfig()
    codes: CodesConfig = CodesConfig()
    shapes: ShapesConfig = ShapesConfig()
    heat: HeatConfig = HeatConfig()
