"""Numbers of the segments: how planes are found in a frame, and when they become one segment."""

from dataclasses import dataclass, field
from math import radians

from pipeline.geometry.config import CellConfig


@dataclass(frozen=True)
class SurfelConfig:
    """How a frame is thinned to surfels, the mean points of blocks of the image.

    Attributes:
        block: pixels, the edge of a block.
        rows: rows of pixels of a block that one label, or one of two surfaces, has to fill.
        depth_step: 1/m of inverse depth, between surfaces one behind the other: three times a structured-light
            camera's resolution.
        deviations: standard deviations of the noise, between surfaces one behind the other. The means of a slope's
            halves are 3.5 apart, those of Gaussian noise 2.7.
        reach: blocks up to this far apart along rows and columns are neighbours.
        spacing: m per m of depth, between neighbouring surfels one block apart: eight times their distance on a
            surface that the camera faces, so that a surface is seen as one down to a grazing angle of 7°.
    """

    block: int = 8
    rows: int = 2
    depth_step: float = 0.01
    deviations: float = 5.0
    reach: int = 2
    spacing: float = 0.12

    @property
    def fewest_pixels(self) -> int:
        """Least number of pixels of a surfel."""
        return self.rows * self.block


@dataclass(frozen=True)
class RegionConfig:
    """How regions grow over surfels, and how planes are fitted to them.

    Attributes:
        angle: rad, between a surfel's normal and its region's.
        step: m, from a surfel to the plane through the one beside it: a region does not jump down a step.
        distance: m, from a surfel to its plane.
        fewest_surfels: of a plane.
        samples: of RANSAC, for each plane: one of 50 has three inliers with a probability of 0.999 if half of the
            surfels are inliers.
        rounds: how often surfels go to the nearest plane and planes are fitted to them again.
    """

    angle: float = radians(20)
    step: float = 0.025
    distance: float = 0.025
    fewest_surfels: int = 10
    samples: int = 50
    rounds: int = 2


@dataclass(frozen=True)
class ExtentConfig:
    """Which pixels show where a plane ends: they are moved along their rays onto the plane.

    Attributes:
        stride: pixels from one to the next.
        shift: m along the optical axis by which a pixel may move.
        noise: m per m² of depth by which it may move farther: 3σ of a structured-light camera (Nguyen et al. 2012).
    """

    stride: int = 2
    shift: float = 0.01
    noise: float = 0.006


@dataclass(frozen=True)
class SegmentsConfig:
    """All numbers of the segments.

    Attributes:
        surfels: of a frame.
        regions: of surfels.
        extent: of a plane.
        cells: in which a segment was seen.
        flatness: m, by which corners of one segment may lie off the plane of another that it continues.
        least_cosine: between the normals of segments that continue each other: corners alone do not distinguish a
            surface from a narrow one that stands on it.
        ascent: rad; a plane that is tilted less has no reliable direction of ascent.
        thickness: of a box, in standard deviations of the noise: two to either side.
        checkpoint: members from one kept state of the fold to the next; a fold begins at the last one before a
            keyframe that moved.
    """

    surfels: SurfelConfig = SurfelConfig()
    regions: RegionConfig = RegionConfig()
    extent: ExtentConfig = ExtentConfig()
    cells: CellConfig = field(default_factory=CellConfig)
    flatness: float = 0.05
    least_cosine: float = 0.5
    ascent: float = radians(8)
    thickness: float = 4.0
    checkpoint: int = 64
