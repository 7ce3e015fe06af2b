"""The commands that hang tags."""

from pathlib import Path
from typing import Any

import pytest

from pipeline.errors import InputError
from sarsim.methods.plugins import make_plugins
from sarsim.plugins.fiducials.plugin import FiducialsConfig
from sarsim.plugins.ros.settings import RosExplorationConfig, RosRobotConfig
from sarsim.settings import EpisodeConfig, MapRecordingConfig, TeleopConfig

PLUGINS: dict[str, Any] = {"fiducials": FiducialsConfig(3)}


@pytest.mark.parametrize(
    "command",
    [
        MapRecordingConfig(path=Path("bag"), out=Path("out"), plugins=PLUGINS),
        RosExplorationConfig(out=Path("out"), plugins=PLUGINS),
        TeleopConfig(plugins=PLUGINS),
    ],
)
def test_commands_that_hang_no_tags_refuse_them(command: Any) -> None:
    with pytest.raises(InputError, match="--fiducials 3"):
        make_plugins(command)


@pytest.mark.parametrize("command", [EpisodeConfig(plugins=PLUGINS), RosRobotConfig(plugins=PLUGINS)])
def test_commands_that_simulate_an_arena_take_them(command: Any) -> None:
    assert [plugin.name for plugin in make_plugins(command)] == ["fiducials"]
