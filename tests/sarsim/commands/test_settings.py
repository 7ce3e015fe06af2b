"""Settings from a YAML file and flags: which wins, what is refused, and that a file written is read back."""

from dataclasses import dataclass, field
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from pathlib import Path
from typing import Literal

import pytest
import yaml
from tyro.conf import Fixed

from pipeline.errors import InputError
from sarsim.commands.settings import load_settings, run_with_settings, save_settings, settings_from
from sarsim.commands.sweep import SweepSettings
from sarsim.settings import EpisodeConfig, MapRecordingConfig
from tests.refusal import refusal


@dataclass(frozen=True)
class Inner:
    """Settings inside others."""

    share: float = 0.5
    hidden: Fixed[bool] = False


@dataclass(frozen=True)
class Outer:
    """All kinds of settings."""

    data: Path
    steps: int = 3
    sensor: Literal["xtion", "ideal"] = "xtion"
    home: bool = False
    goals: tuple[tuple[float, float], ...] = ()
    detector: tuple[Path, Path] | None = (Path("a"), Path("b"))
    start: tuple[float, float, float] | None = None
    out: Path | None = None
    inner: Inner = field(default_factory=Inner)


FULL = Outer(Path("d"), 9, "ideal", True, ((1.0, -2.0), (1e-7, 4.0)), None, (0.5, 0, 90), inner=Inner(0.25, True))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "config.yaml"
    save_settings(FULL, path)
    return path


def test_what_a_run_writes_repeats_it(file: Path) -> None:
    assert load_settings(Outer, file) == FULL
    assert settings_from(Outer, ["--config", str(file)]) == FULL
    assert settings_from(Outer, [f"--config={file}"]) == FULL


def test_a_flag_takes_back_an_optional_value_of_the_file(file: Path) -> None:
    assert settings_from(Outer, ["--config", str(file), "--start", "None"]).start is None


def test_a_run_without_a_detector_has_a_flag_of_its_own(file: Path) -> None:
    assert settings_from(EpisodeConfig, ["--no-detector"]).detector is None
    assert settings_from(SweepSettings, ["--seeds", "1", "2", "--no-detector"]).detector is None


def test_flags_override_the_file_and_the_file_the_defaults(file: Path) -> None:
    flags = ["--steps", "5", "--no-home", "--inner.share", "1", "--goals", "--config", str(file)]
    given = settings_from(Outer, flags)
    assert (given.steps, given.home, given.inner, given.goals) == (5, False, Inner(1, True), ())
    assert given.sensor == "ideal"


def test_a_file_need_not_hold_everything(tmp_path: Path) -> None:
    path = tmp_path / "some.yaml"
    path.write_text("inner: {share: 1}\nsteps: 4\n")
    assert settings_from(Outer, ["--data", "d", "--config", str(path)]) == Outer(Path("d"), 4, inner=Inner(1.0))
    with pytest.raises(InputError, match="--data"):
        settings_from(Outer, ["--config", str(path)])


def test_folders_for_results_and_default_paths_are_not_written(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    save_settings(Outer(Path("d"), out=Path("results")), path)
    assert set(yaml.safe_load(path.read_text())) == {"data", "steps", "sensor", "home", "goals", "start", "inner"}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("steps: many", "steps: 'many' is not a valid value: Input should be a valid integer"),
        ("steps: 2.5", "steps: 2.5 is not a valid value"),
        ("steps: '2'", "steps: '2' is not a valid value"),
        ("home: 1", "home: 1 is not a valid value"),
        ("sensor: kinect", "Input should be 'xtion' or 'ideal'"),
        ("inner: {share: .nan}", "inner: Out of range float values"),
        ("inner: {share: a}", "inner.share: 'a' is not a valid value"),
        ("inner: 3", "inner: 3 is not a valid value"),
        ("steps: {a: 1}", "steps: {'a': 1} is not a valid value"),
        ("stepz: 3", "unknown setting stepz; perhaps you meant steps"),
        ("inner: {shar: 1}", "unknown setting inner.shar; perhaps you meant share"),
        ("- 3", "such as 'steps: 20', not [3]"),
        ("", "such as 'steps: 20', but is empty"),
        ("a: [", "not valid YAML"),
        ("steps: 1\nsteps: 2", "the key 'steps' occurs twice"),
        ("goals: [1, 2, 3]", "goals: 1 is not a valid value"),
        ("out: /home/me/.ssh", "give --out"),
        ("goals: &a [1, 2]\nstart: *a", "aliases are not allowed; write out the value of *a"),
        ("[" * 90_000, "more than 8 levels deep"),
        ("steps: " + "9" * 5000, "not valid YAML"),
        ("steps: 1\n" * 20_000, "the file has 180000 bytes; the limit is 100000 bytes"),
        (b"arena: Z\xfcrich", "UTF-8"),
        (None, "No such file"),
    ],
)
def test_a_bad_file_is_one_line_and_status_2(
    text: str | bytes | None, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "config.yaml"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    flags = ["--data", "d", "--config", str(path)]
    line = refusal(capsys, run_with_settings, lambda settings: None, Outer, flags)
    assert line.startswith(f"error: --config {path}: ")
    assert complaint in line


@pytest.mark.parametrize(
    "text",
    [
        "exploration: os:getcwd",
        "labels: os:getcwd",
        "detector: os:getcwd",
        "detector: [os:getcwd]",
        "detector_class: os:getcwd",
        "detector-class: installed",
        "localisation: os:getcwd",
        "planner: os:getcwd",
        "sink: [os:getcwd]",
        "sink: mine",
        "reader: [[my:Own]]",
        "arena: os:getcwd",
        "arena: [os.path:join]",
    ],
)
def test_a_file_names_no_code_that_runs(text: str, tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(f"{text}\n")
    flag = text.partition(":")[0].replace("_", "-")
    with pytest.raises(InputError, match=f"give --{flag} as a flag"):
        load_settings(EpisodeConfig, path)


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        (SweepSettings, "methods: [next_best_view, theirs]"),
        (EpisodeConfig, "exploration: theirs"),
        (EpisodeConfig, "mission: theirs"),
        (EpisodeConfig, "mission: field.theirs"),
        (MapRecordingConfig, "mission: theirs.yaml"),
    ],
)
def test_a_file_names_no_installed_code_of_others(
    kind: type, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    theirs = ("exploration", "theirs"), ("mission", "theirs"), ("mission", ".theirs"), ("mission", "theirs.yaml")
    entries = [EntryPoint(name, "os:getcwd", f"sarsim.{group}") for group, name in theirs]
    known = EntryPoints([*entries, *entry_points(group="sarsim.mission")])
    monkeypatch.setattr("sarsim.settings.entry_points", known.select)
    path = tmp_path / "config.yaml"
    path.write_text(f"{text}\n")
    with pytest.raises(InputError, match=f"give --{text.partition(':')[0]} as a flag"):
        load_settings(kind, path)
    for mission in ("explore", "league", "mine.yaml"):
        path.write_text(f"mission: {mission}\n")
        assert load_settings(EpisodeConfig, path).mission == mission


def test_flags_may_choose_the_code_that_a_file_must_not(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text("sink: [my:Own]\nlabels: os:getcwd\ndetector_class: my:Other\nseed: 3\n")
    words = "--sink my:Own --sink my:Other --arena my:hall --labels my:Own --detector-class=my:Own --config"
    given = settings_from(EpisodeConfig, [*words.split(), str(path)])
    assert (given.sink, given.arena, given.seed) == (("my:Own", "my:Other"), "my:hall", 3)
    assert (given.labels, given.detector_class) == ("my:Own", "my:Own")
    path.write_text("arena: random:3\nsink: []\nreader: []\ndetector_class: null\n")
    assert load_settings(EpisodeConfig, path).arena == "random:3"


def test_every_number_of_a_run_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    config = EpisodeConfig(goals=((1, 2.5),), start=(0, 1, 90), speed=0.5, view="web")
    save_settings(config, path)
    assert load_settings(EpisodeConfig, path) == config
