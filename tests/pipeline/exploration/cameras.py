"""The camera that the tests of the exploration look with."""

import numpy as np

from pipeline.exploration.visibility_kernels import CameraView

CAMERA = CameraView(
    height=0.6,
    ahead=0.17,
    near=0.9,
    far=3.1,
    lower_edge=np.deg2rad(-34),
    upper_edge=np.deg2rad(9),
    field_of_view=np.deg2rad(54),
)
"""An Xtion on the mast of a Pioneer, 12° down."""
