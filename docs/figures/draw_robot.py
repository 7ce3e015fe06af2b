"""Draw the picture for the robots' page."""

from pathlib import Path

import sarsim  # noqa: F401 - before mujoco: rendering without a screen

# isort: split
import cv2
import mujoco

from sarsim.assets import asset

IMAGE = Path(__file__).parents[1] / "images" / "pioneer3at.jpg"


def main() -> None:
    """Let the robot settle, and draw it with its scene's camera."""
    model = mujoco.MjModel.from_xml_path(str(asset("robots", "pioneer3at", "scene.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    with mujoco.Renderer(model, 720, 960) as renderer:
        renderer.update_scene(data, "portrait")
        cv2.imwrite(str(IMAGE), renderer.render()[..., ::-1])


if __name__ == "__main__":
    main()
