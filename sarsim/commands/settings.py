"""Settings as dataclasses: a field is a flag, and a key of the YAML that ``--config`` reads and every run writes."""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, field, fields, is_dataclass, make_dataclass, replace
from difflib import get_close_matches
from inspect import getdoc
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_type_hints

import tyro
import yaml

from pipeline.errors import InputError
from pipeline.files import atomic_write, read_text
from pipeline.plugins.league.brief import MissionBrief, Task
from sarsim.assets import asset
from sarsim.commands.cli import COMMON, common, guarded, parse
from sarsim.commands.names import check_names
from sarsim.settings import EXPLORE, METHODS, names_code, words

CONFIG = tyro.conf.arg(
    help="YAML file of settings, such as the config.yaml of an earlier run; flags override it.", help_behavior_hint=""
)
RESULTS = ("out", "resume", "bag", "tum", "json")
"""Where results go: only flags may set these, because a settings file may come from someone else."""
OUTPUTS = (*RESULTS, "workers")
"""Settings left out of a run's config.yaml, so that a repeat overwrites no results and may use other workers."""

MISSIONS = ("league", "virtual")
"""Names of the missions that sarsim ships."""
MOST_SETTINGS, DEEPEST = 100_000, 8
"""Maximum size and nesting depth of a settings file; one that a run writes has 1,500 bytes and 3 levels."""
SCALARS: dict[Any, tuple[type, ...]] = {float: (int, float), int: (int,), bool: (bool,), str: (str,)}
"""Types of settings that YAML supports, each with the types of value that it accepts."""
Settings = TypeVar("Settings")


def run_with_settings(
    command: Callable[[Settings], object],
    kind: type[Settings],
    args: Sequence[str] | None = None,
    prog: str | None = None,
) -> None:
    """Like :func:`sarsim.commands.cli.run`, for a dataclass whose fields become flags, together with ``--config``."""

    def run() -> None:
        words = common(args)
        about = getdoc(getattr(command, "func", command))
        settings = settings_from(kind, words, f"{about}\n\n{COMMON}", prog)
        check_names(vars(settings))
        command(settings)

    guarded(run)


def run_one_of(commands: Mapping[str, tuple[Callable[[Any], object], type]], description: str) -> None:
    """Like :func:`run_with_settings`, for the command that the first word of the command line names."""
    name, *words = sys.argv[1:] or [""]
    if name in commands:
        run_with_settings(*commands[name], words, f"{Path(sys.argv[0]).name} {name}")
        return
    kinds: dict[str, Callable[..., Any]] = {name: kind for name, (_, kind) in commands.items()}
    about = f"{description}\n\n{COMMON}"

    def run() -> None:
        if name and not name.startswith("-"):
            meant = "".join(f"; perhaps you meant {near}" for near in get_close_matches(name, commands, n=1))
            raise InputError(f"unknown subcommand {name!r}: must be one of {', '.join(commands)}{meant}")
        words = common()
        parse(lambda: tyro.extras.subcommand_cli_from_dict(kinds, args=words, description=about))

    guarded(run)


def settings_from(
    kind: type[Settings], args: Sequence[str], description: str | None = None, prog: str | None = None
) -> Settings:
    """The settings that ``args`` give; the defaults are those in the file of ``--config`` or ``--resume``, if given.

    Raises:
        InputError: a flag or the file is wrong.
    """
    found = config_file(args)
    default: dict[str, Any] = {"default": load_settings(kind, found[1], args, found[0])} if found else {}
    flags = make_dataclass(
        "Flags",
        [
            ("settings", Annotated[kind, tyro.conf.arg(name="")], field(**default)),
            ("config", Annotated[Path | None, CONFIG], field(default=None)),
        ],
    )
    return parse(
        lambda: tyro.cli(flags, prog=prog, description=description, args=args, config=(tyro.conf.SuppressFixed,))
    ).settings


def config_file(args: Sequence[str]) -> tuple[str, Path] | None:
    """The flag that names a settings file, and the file: that of ``--config``, or the one in the ``--resume`` folder.

    Raises:
        InputError: both flags are given, or there is nothing to resume.
    """
    finder = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    for flag in ("--config", "--resume"):
        finder.add_argument(flag, nargs="?", type=Path)
    found = finder.parse_known_args(args)[0]
    if found.config and found.resume:
        raise InputError(
            f"--config {found.config}: cannot be combined with --resume, which uses that episode's settings"
        )
    if found.resume is None:
        return found.config and ("config", found.config)
    if not (file := found.resume / "config.yaml").is_file():
        what = (
            f"has no {file.name}, so it is not the folder of an episode"
            if found.resume.is_dir()
            else "no such folder"
        )
        raise InputError(f"--resume {found.resume}: {what}")
    return "resume", file


def load_mission(name: str) -> MissionBrief:
    """The mission that ``--mission`` names: league, virtual, or a YAML file.

    Raises:
        InputError: the file cannot be read, or contains an unknown key or an invalid value.
    """
    is_own = name in MISSIONS
    return load_settings(MissionBrief, asset("missions", f"{name}.yaml") if is_own else Path(name), flag="mission")


def wanted_mission(mission: str, minutes: float | None = None, home: bool = False) -> MissionBrief | None:
    """The mission that ``--mission``, ``--minutes`` and ``--home`` describe; None to explore without a time limit.

    Raises:
        InputError: see :func:`load_mission`.
    """
    if mission == EXPLORE:
        return None
    brief = load_mission(mission)
    tasks: tuple[Task, ...] = (*brief.tasks, "home") if home and "home" not in brief.tasks else brief.tasks
    return replace(brief, minutes=brief.minutes if minutes is None else minutes, tasks=tasks)


def load_settings(kind: type[Settings], path: Path, args: Sequence[str] = (), flag: str = "config") -> Settings:
    """Settings from a YAML file; ``tyro.MISSING`` for fields without a value in the file and in ``kind``.

    User code for one of ``METHODS`` is accepted only as a flag in ``args``: a file must not choose code to run.

    Raises:
        InputError: the file cannot be read, or contains an unknown key or a value of the wrong type, or
            sets what only a flag may set.
    """
    where = f"--{flag} {path}"
    content = _yaml(path, where)
    if isinstance(content, dict) and (places := sorted(content.keys() & set(RESULTS))):
        raise InputError(f"{where}: a file must not set where results go; give --{places[0]} as a flag")
    for key in list(content) if isinstance(content, dict) else []:
        name = str(key).replace("_", "-")
        if name in METHODS and names_code(name, content[key]):
            if not any(word.split("=")[0].replace("_", "-") == f"--{name}" for word in args):
                raise InputError(f"{where}: a file must not choose code to run; give --{name} as a flag")
            del content[key]
    return _settings(kind, content, where)


def _yaml(path: Path, where: str) -> Any:
    """The content of a YAML file; if it is not valid YAML, an InputError that begins with ``where``."""
    try:
        text, depth = read_text(path, MOST_SETTINGS), 0
        for event in yaml.parse(text):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent):
                raise InputError(f"{path}: aliases are not allowed; write out the value of *{event.anchor}")
            if depth > DEEPEST:
                raise InputError(f"{path}: settings must not be nested more than {DEEPEST} levels deep")
        return yaml.safe_load(text)
    except InputError as error:
        raise InputError(f"{where.partition(' ')[0]} {error}") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(f"{where}: not valid YAML: {' '.join(str(error).split())}") from error


def save_settings(settings: Any, path: Path) -> None:
    """Write settings as YAML for ``--config``, without :data:`OUTPUTS` and paths that have their default value.

    Raises:
        InputError: the file cannot be written.
    """
    with atomic_write(path) as file:
        file.write_text(yaml.safe_dump(_plain(settings), sort_keys=False, default_flow_style=False))


def _settings(kind: Any, content: Any, where: str) -> Any:
    """An instance of a dataclass from a mapping; ``where`` begins the error messages."""
    if not isinstance(content, dict):
        found = "but is empty" if content is None else f"not {content!r:.60}"
        raise InputError(f"{where}: must contain settings with their values, such as 'steps: 20', {found}")
    given = {str(key).replace("-", "_"): value for key, value in content.items()}
    hints = get_type_hints(kind)
    if unknown := [key for key in given if key not in hints]:
        meant = "".join(f"; perhaps you meant {near}" for near in get_close_matches(unknown[0], hints, n=1))
        raise InputError(f"{where}: unknown setting {', '.join(unknown)}{meant}")
    values = {name: _value(hints[name], value, f"{where}: {name.replace('_', '-')}") for name, value in given.items()}
    required = [f.name for f in fields(kind) if f.default is MISSING and f.default_factory is MISSING]
    return kind(**dict.fromkeys(required, tyro.MISSING) | values)


def _value(hint: Any, value: Any, where: str) -> Any:
    """A value of a YAML file, converted to the type of its setting."""
    if is_dataclass(hint):
        return _settings(hint, value, where)
    if hint in SCALARS and type(value) in SCALARS[hint]:
        return hint(value)
    if isinstance(value, dict):
        raise InputError(f"{where}: must be a single value, not a group of settings")
    one = make_dataclass("One", [("value", hint)])
    try:
        return parse(lambda: tyro.cli(one, args=["--value", *words(value)])).value
    except InputError:
        raise InputError(f"{where}: {value!r} is not a valid value; see --help for the accepted ones") from None


def _plain(settings: Any) -> dict[str, Any]:
    """A dataclass as values that YAML can represent."""
    plain = {}
    for f in fields(settings):
        value = getattr(settings, f.name)
        if is_dataclass(value):
            plain[f.name] = _plain(value)
        elif f.name not in OUTPUTS and not ("Path" in str(f.type) and value == f.default):
            plain[f.name] = _plain_value(value)
    return plain


def _plain_value(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain_value(item) for item in value]
    if isinstance(value, float):
        return float(value)  # YAML does not support NumPy's floats
    return str(value) if isinstance(value, Path) else value
