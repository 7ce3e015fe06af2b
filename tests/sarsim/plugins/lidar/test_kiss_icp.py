"""KISS-ICP, which knows nothing of sarsim, finds the robot's way in the files of a dataset."""

from dataclasses import replace

import numpy as np
import pytest

from sarsim.dataset.generate import generate
from sarsim.plugins.lidar.config import LidarConfig
from tests.sarsim.dataset.small import RECIPE, InProcess

pytest.importorskip("kiss_icp")


def test_the_way_of_the_robot_is_found_from_scans_alone(tmp_path):
    from kiss_icp.config import KISSConfig
    from kiss_icp.config.config import AdaptiveThresholdConfig, DataConfig, MappingConfig
    from kiss_icp.datasets.generic import GenericDataset
    from kiss_icp.kiss_icp import KissICP

    recipe = replace(RECIPE, frames=40, frames_per_second=10, plugins={"lidar": LidarConfig("32x720", noise=False)})
    generate(recipe, 1, tmp_path, InProcess())
    folder = tmp_path / "lidar/sequences/00"
    true = np.loadtxt(folder / "poses.txt").reshape(-1, 3, 4)
    scans = GenericDataset(folder / "velodyne")
    config = KISSConfig(
        data=DataConfig(max_range=20, deskew=False),
        mapping=MappingConfig(voxel_size=0.1),
        adaptive_threshold=AdaptiveThresholdConfig(initial_threshold=0.3),  # lanes are 1.2 m wide
    )
    odometry = KissICP(config)
    found = []
    for index in range(len(scans)):
        odometry.register_frame(*scans[index])
        found.append(odometry.last_pose)
    R, t = true[0, :, :3], true[0, :, 3]
    places = np.array(found)[:, :3, 3] @ R.T + t
    turned = np.arccos(np.clip((np.trace(R.T @ true[-1, :, :3]) - 1) / 2, -1, 1))
    assert np.linalg.norm(true[-1, :, 3] - t) + turned > 0.3  # the robot drives, or turns
    assert np.abs(places - true[:, :, 3]).max() < config.mapping.voxel_size
    agree = np.array([found[k][:3, :3].T @ R.T @ true[k, :, :3] for k in range(len(found))])
    assert np.trace(agree, axis1=1, axis2=2).min() > 1 + 2 * np.cos(0.03)
