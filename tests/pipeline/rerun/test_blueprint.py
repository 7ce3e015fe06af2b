"""The layout of a recording."""

import numpy as np

from pipeline.rerun.blueprint import eye


def test_no_wall_hides_more_than_its_height_behind_it() -> None:
    low, high = np.array([-3.0, -2.0, 0.0]), np.array([3.0, 2.0, 1.2])
    controls = eye(low, high)
    (place,), (target,) = (
        np.array(part.as_arrow_array().to_pylist()) for part in (controls.position, controls.look_target)
    )
    np.testing.assert_allclose(target, (low + high) / 2)
    corners = np.array([(x, y, 0.0) for x in (low[0], high[0]) for y in (low[1], high[1])])
    level = np.linalg.norm((place - corners)[:, :2], axis=1)
    assert (place[2] - corners[:, 2] > level).all()
