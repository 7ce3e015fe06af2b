"""A detector with the simulator's ground truth of the people in view."""

import numpy as np
from numpy.typing import NDArray

from pipeline.victims.detection import Detection
from sarsim.dataset.image_kernels import victim_boxes
from sarsim.simulated_robot import SimulatedRobot
from sarsim.victims.victims import victims_of


class TrueDetector:
    """Detects the visible part of each victim in a simulated robot's newest frame."""

    def __init__(self, robot: SimulatedRobot, least: int = 100):
        """``least``: smallest number of pixels of a victim that is found."""
        model, data = robot.physics.model.ptr, robot.physics.data.ptr
        self._robot, self._least = robot, least
        self._victims = victims_of(model, data)
        self._victim_of_geom = np.full(model.ngeom, -1, np.int16)
        for number, victim in enumerate(self._victims):
            self._victim_of_geom[victim.geoms] = number

    def detect(self, rgb: NDArray[np.uint8]) -> list[Detection]:
        """The detections in the image ``rgb``, which must be that of the newest frame."""
        assert self._robot.true_frame is not None
        boxes = np.zeros((len(self._victims), 4), np.int32)
        pixels = np.zeros(len(self._victims), np.int32)
        victim_boxes(self._robot.true_frame.image.instance, self._victim_of_geom, boxes, pixels)
        return [Detection((x0, y0, x1, y1), 0.9) for x0, y0, x1, y1 in boxes[pixels >= self._least].tolist()]
