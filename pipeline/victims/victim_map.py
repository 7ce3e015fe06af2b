"""Victims on the map: the observations of each person, and whether these suffice to confirm the person."""

from collections.abc import Sequence
from dataclasses import replace

from pipeline.arrays import Pose
from pipeline.frame import Frame
from pipeline.tracks.config import PeopleConfig
from pipeline.tracks.find import VICTIM
from pipeline.tracks.track import Observation, Track
from pipeline.tracks.tracks import Tracks, join_nearest
from pipeline.transforms import inverse
from pipeline.victims.detection import Detection
from pipeline.victims.observation import Refusal, observe
from pipeline.victims.people import VOXEL, PeoplePolicy, PersonVoxels


class Victims(Tracks):
    """All people, confirmed or not.

    Attributes:
        policy: how people are tracked.
        refusals: detections in the last frame that are not people.
    """

    def __init__(self, config: PeopleConfig = PeopleConfig()) -> None:
        super().__init__(join_nearest)
        self.policy = PeoplePolicy(**vars(config))
        self.refusals: list[Refusal] = []

    def update(self, frame: Frame, detections: Sequence[Detection], T_map_camera: Pose, keyframe: int) -> None:
        """Add observations of a keyframe's detections, and count misses of people whom it was expected to show.

        Args:
            frame: the keyframe's frame, with its depth.
            detections: detections in the keyframe's image, possibly none; other kinds than people are ignored.
            T_map_camera: pose of ``camera_optical`` in ``map``.
            keyframe: index of the keyframe.
        """
        people = [detection for detection in detections if detection.kind == VICTIM]
        seen = [observe(frame, detection, T_map_camera, keyframe, self.policy) for detection in people]
        self.refusals = [item for item in seen if isinstance(item, Refusal)]
        T_map_base = T_map_camera @ inverse(frame.T_base_camera)
        new = [self._track(o, T_map_base) for o in seen if isinstance(o, Observation)]
        self.add(new, frame, T_map_camera, keyframe)

    def _track(self, observation: Observation, T_map_base: Pose) -> Track:
        """A track of a single observation in ``map``."""
        thinned = replace(observation, points=PersonVoxels.of(observation.points, VOXEL).points)
        seen = thinned.transformed(inverse(T_map_base))
        # The track is placed from the stored observation, so that a rebuilt map is identical.
        return Track(self.policy, [seen], [seen.transformed(T_map_base)], float(T_map_base[2, 3]))
