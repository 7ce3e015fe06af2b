"""Parameters of the semantic map: how points are classified, and how the map revises their classes."""

from dataclasses import dataclass, field
from math import radians

from pipeline.segments.config import RegionConfig, SurfelConfig


@dataclass(frozen=True)
class RuleConfig:
    """How the baseline classifies points by height and slope.

    Attributes:
        voxel: edge length of a voxel, m; the cloud is thinned to one point per voxel.
        neighbours: number of points to which a plane is fitted for the normal.
        wall_tilt: minimum tilt of a wall, rad.
        roughness: maximum standard deviation from the plane of the neighbours, m; rougher points are clutter.
        deck: height above the ground where the robot was set down, m; level surfaces above it are straight ramps.
        ceiling: height above the same ground, m; level surfaces above it are ceilings.
    """

    voxel: float = 0.03
    neighbours: int = 30
    wall_tilt: float = radians(60)
    roughness: float = 0.03
    deck: float = 0.08
    ceiling: float = 2.0


@dataclass(frozen=True)
class PlanarVoteConfig:
    """How the points of a plane vote on their classes.

    Attributes:
        surfels: how a frame is thinned to surfels.
        regions: how regions of surfels grow; the angle is small, because no labels separate planes here.
        shift, noise: a pixel is less than ``shift + noise · depth²`` from its plane along the optical axis; m, 1/m.
        window: if a pixel fits several planes, the pixels up to this far away in rows and columns help to decide.
        weight: weight of the mean log probabilities of a plane's points; a point's own log probabilities weigh 1.
        least_probability: lower limit of a class's probability; it limits the evidence against a class.
        lean: maximum angle of a floor, deck or ceiling to the horizontal, and of a wall or the side of a deck to the
            vertical, rad.
        least_ramp: minimum tilt of an inclined ramp, rad.
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
        grids: number of grids of columns, shifted relative to each other; class probabilities are averaged over them.
        vote: how the points of a plane vote.
    """

    grids: int = 3
    vote: PlanarVoteConfig = PlanarVoteConfig()


@dataclass(frozen=True)
class UprightsConfig:
    """How upright surfaces are recognised in a grid seen from above.

    Attributes:
        reach: distance up to which points around a cell determine the direction of a wall, cells; with less, noise
            would dominate. Within this distance of a corner, the directions of both walls mix.
        blur: uncertainty of the edge of a ramp's top, cells: one due to noise, one due to the grid.
    """

    reach: int = 2
    blur: int = 2


@dataclass(frozen=True)
class SemanticMapConfig:
    """All parameters of the semantic map.

    Attributes:
        voxel: edge length of a voxel, m; each voxel keeps one point, whatever the number of frames.
        skin: points within this distance of the points of a find belong to the find, m.
        uprights: how walls and the sides of ramps are recognised.
        rules: parameters of the baseline.
        network: parameters of the network classifier.
    """

    voxel: float = 0.02
    skin: float = 0.03
    uprights: UprightsConfig = UprightsConfig()
    rules: RuleConfig = RuleConfig()
    network: NetworkConfig = NetworkConfig()
