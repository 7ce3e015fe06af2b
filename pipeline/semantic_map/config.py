"""Numbers of the semantic map: how points get classes, and how the map revises them."""

from dataclasses import dataclass, field
from math import radians

from pipeline.segments.config import RegionConfig, SurfelConfig


@dataclass(frozen=True)
class RuleConfig:
    """How the baseline classifies points by height and slope.

    Attributes:
        voxel: m; the cloud is thinned to one point a voxel.
        neighbours: points to which a normal is fitted.
        wall_tilt: rad; a surface at least as steep is a wall.
        roughness: m, standard deviation from the plane of the neighbours; what is rougher is clutter.
        ramp_tilt: rad; a surface at least as steep is an inclined ramp.
        deck: m over where the robot was set down; a level surface above this is a straight ramp, not terrain.
        ceiling: m, likewise; a level surface above this is a ceiling.
    """

    voxel: float = 0.03
    neighbours: int = 30
    wall_tilt: float = radians(60)
    roughness: float = 0.03
    ramp_tilt: float = radians(8)
    deck: float = 0.08
    ceiling: float = 2.0


@dataclass(frozen=True)
class PlanarVoteConfig:
    """How the points of a plane vote on their classes.

    Attributes:
        surfels: to which a frame is thinned.
        regions: of surfels; narrow, because no labels separate planes here.
        shift: m along the optical axis, greatest distance of a pixel from its plane.
        noise: m per m² of depth that is added to it.
        window: pixels around a pixel that fits several planes, whose depths decide between these planes.
        weight: of the mean log probabilities of a plane's points; a point's own log probabilities weigh 1.
        least_probability: of a class; it limits the evidence of a network that rules a class out.
        lean: rad by which the floor, a deck or a ceiling may be out of level, and a wall or a side of a deck out of
            plumb.
        least_ramp: rad, least tilt of an inclined ramp.
    """

    surfels: SurfelConfig = field(default_factory=SurfelConfig)
    regions: RegionConfig = field(default_factory=lambda: RegionConfig(angle=radians(6)))
    shift: float = 0.02
    noise: float = 0.008
    window: int = 2
    weight: float = 2.0
    least_probability: float = 1e-3
    lean: float = radians(15)
    least_ramp: float = radians(4)


@dataclass(frozen=True)
class NetworkConfig:
    """How a network classifies a frame.

    Attributes:
        grids: of columns, each shifted against the others, over which class probabilities are averaged.
        vote: of the points of a plane.
    """

    grids: int = 3
    vote: PlanarVoteConfig = PlanarVoteConfig()


@dataclass(frozen=True)
class UprightsConfig:
    """What stands upright, in cells of a plan.

    Attributes:
        reach: cells around a cell whose points show which way a wall runs; with fewer, noise would decide. So far the
            directions of two walls mix in a corner.
        blur: cells by which the edge of a ramp's top is blurred: one by noise, one by the grid.
    """

    reach: int = 2
    blur: int = 2


@dataclass(frozen=True)
class SemanticMapConfig:
    """All numbers of the semantic map.

    Attributes:
        voxel: m, the edge of the voxels; each keeps one point whatever the number of frames.
        skin: m; a point this near to the points of what was found belongs to it.
        uprights: walls and the sides of ramps.
        rules: of the baseline.
        network: of the classifier.
    """

    voxel: float = 0.02
    skin: float = 0.03
    uprights: UprightsConfig = UprightsConfig()
    rules: RuleConfig = RuleConfig()
    network: NetworkConfig = NetworkConfig()
