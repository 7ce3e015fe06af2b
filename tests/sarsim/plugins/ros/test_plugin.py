"""The commands that write a bag."""

from pathlib import Path
from typing import Any

import pytest

from pipeline.errors import InputError
from sarsim.methods.plugins import make_plugins
from sarsim.plugins.ros.plugin import BagConfig
from sarsim.plugins.ros.settings import RosExplorationConfig
from sarsim.settings import EpisodeConfig, MapRecordingConfig, TeleopConfig

PLUGINS: dict[str, Any] = {"bag": BagConfig(Path("written"))}


@pytest.mark.parametrize(
    "command",
    [
        MapRecordingConfig(path=Path("bag"), out=Path("out"), plugins=PLUGINS),
        RosExplorationConfig(out=Path("out"), plugins=PLUGINS),
    ],
)
def test_commands_that_write_no_bag_refuse_one(command: Any) -> None:
    with pytest.raises(InputError, match="--bag"):
        make_plugins(command)


@pytest.mark.parametrize("command", [EpisodeConfig(plugins=PLUGINS), TeleopConfig(plugins=PLUGINS)])
def test_commands_that_drive_a_simulated_robot_with_maps_write_one(command: Any) -> None:
    assert [plugin.name for plugin in make_plugins(command)] == ["bag"]
