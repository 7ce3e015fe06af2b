"""How many steps a robot explores before it drives to goals, by the flags."""

from math import inf

import pytest

from pipeline.errors import InputError
from sarsim.commands.settings import settings_from
from sarsim.settings import EpisodeConfig

GOALS = ["--goals", "1", "2"]


@pytest.mark.parametrize(
    ("flags", "most"),
    [
        ([], inf),
        (["--steps", "7"], 7),
        (GOALS, 0),
        ([*GOALS, "--steps", "7"], 7),
        ([*GOALS, "--explore"], inf),
        ([*GOALS, "--explore", "--steps", "7"], 7),
        (["--explore"], inf),
    ],
)
def test_goals_are_driven_to_at_once_unless_exploring_is_asked_for(flags, most):
    assert settings_from(EpisodeConfig, flags).max_steps == most


def test_no_steps_in_a_file_are_as_good_as_none_given(tmp_path):
    file = tmp_path / "config.yaml"
    file.write_text("steps: null\ngoals: [[1, 2]]\n")
    assert settings_from(EpisodeConfig, ["--config", str(file)]).max_steps == 0
    assert settings_from(EpisodeConfig, ["--config", str(file), "--steps", "3"]).max_steps == 3


@pytest.mark.parametrize("flags", [["--steps", "0"], ["--goals", "1", "nan"], ["--goals", "inf", "1"]])
def test_what_makes_no_sense_is_refused(flags):
    with pytest.raises(InputError, match=flags[0]):
        settings_from(EpisodeConfig, flags)
