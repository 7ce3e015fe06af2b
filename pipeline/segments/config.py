"""Parameters of the segments: how planes are found in a frame, and when they become one segment."""

from dataclasses import dataclass, field
from math import radians

from pipeline.errors import require_at_least, require_positive
from pipeline.geometry.config import CellConfig


@dataclass(frozen=True)
class SurfelConfig:
    """How a frame is thinned to surfels, the mean points of image blocks.

    Attributes:
        block: edge length of a block, pixels.
        rows: minimum number of pixels of a label, or of each of two surfaces, in a block, counted in rows of a block.
        depth_step: minimum difference in inverse depth between two surfaces one behind the other, 1/m: three times
            the resolution of a structured-light camera.
        deviations: minimum difference between the mean inverse depths of two such surfaces, in standard deviations
            within them. The halves of a slope differ by 3.5, those of Gaussian noise by 2.7.
        reach: maximum distance between neighbours along rows and columns, blocks.
        spacing: maximum distance between neighbouring surfels one block apart, m per m of depth: eight times that on
            a surface facing the camera, so that surfaces stay connected down to a grazing angle of 7°.
    """

    block: int = 8
    rows: int = 2
    depth_step: float = 0.01
    deviations: float = 5.0
    reach: int = 2
    spacing: float = 0.12

    @property
    def fewest_pixels(self) -> int:
        """Minimum number of pixels of a surfel."""
        return self.rows * self.block

    def __post_init__(self) -> None:
        require_at_least(1, "segments.surfels", self, "block", "rows", "reach")


@dataclass(frozen=True)
class RegionConfig:
    """How regions grow over surfels, and how planes are fitted to them.

    Attributes:
        angle: maximum angle between the normals of a surfel and its region, rad.
        step: maximum distance of a surfel from the plane through its neighbour, m, so that a region does not jump
            down a step.
        distance: maximum distance of a surfel from its plane, m.
        fewest_surfels: minimum number of surfels of a plane.
        samples: number of RANSAC samples for each plane. If half of the surfels are inliers, at least one of 50
            samples consists of three inliers with a probability of 0.999.
        rounds: how often surfels are reassigned to the nearest plane and the planes fitted again.
    """

    angle: float = radians(20)
    step: float = 0.025
    distance: float = 0.025
    fewest_surfels: int = 10
    samples: int = 50
    rounds: int = 2

    def __post_init__(self) -> None:
        require_positive("segments.regions", self, "distance")
        require_at_least(1, "segments.regions", self, "samples")
        require_at_least(3, "segments.regions", self, "fewest_surfels")


@dataclass(frozen=True)
class ExtentConfig:
    """Which pixels determine the extent of a plane; they are moved along their rays onto the plane.

    Attributes:
        stride: step between these pixels, along rows and columns.
        shift, noise: a pixel may move by less than ``shift + noise · depth²`` along the optical axis; m, 1/m. The
            noise is 3σ of a structured-light camera (Nguyen et al. 2012).
    """

    stride: int = 2
    shift: float = 0.01
    noise: float = 0.006

    def __post_init__(self) -> None:
        require_at_least(1, "segments.extent", self, "stride")


@dataclass(frozen=True)
class SegmentsConfig:
    """All parameters of the segments.

    Attributes:
        surfels: how a frame is thinned.
        regions: how planes are found.
        extent: which pixels determine the extent of a plane.
        cells: the cells in which a segment was seen.
        flatness: maximum distance of the corners of a segment's box, less half its thickness, from the plane of a
            segment that it continues, m.
        least_cosine: minimum cosine between the normals of segments that continue each other. Corners alone do not
            distinguish a surface from a narrow one that stands on it.
        thickness: thickness of a box, in standard deviations of the noise: two on either side.
        checkpoint: number of members between saved states. When a keyframe moves, members are merged again from the
            last state saved before it.
    """

    surfels: SurfelConfig = SurfelConfig()
    regions: RegionConfig = RegionConfig()
    extent: ExtentConfig = ExtentConfig()
    cells: CellConfig = field(default_factory=CellConfig)
    flatness: float = 0.05
    least_cosine: float = 0.5
    thickness: float = 4.0
    checkpoint: int = 64

    def __post_init__(self) -> None:
        require_at_least(1, "segments", self, "checkpoint")
