"""Settings as dataclasses; each field is a flag, and a key in the YAML files of ``--config`` and of every run."""

import argparse
import json
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import MISSING, asdict, field, fields, is_dataclass, make_dataclass, replace
from difflib import get_close_matches
from functools import partial
from inspect import getdoc
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_type_hints

import tyro
import yaml

from pipeline.errors import InputError
from pipeline.files import atomic_write, read_text
from sarsim.commands.cli import COMMON_FLAGS_HELP, apply_common_flags, check_names, parse, program, run_guarded
from sarsim.methods.plugins import is_portable, may_be_in_file, plugins_help, settings_of, shipped_plugin, split_flags
from sarsim.settings import chooses_code

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

CONFIG = tyro.conf.arg(
    help="YAML file of settings, such as the config.yaml of an earlier run; flags override it.", help_behavior_hint=""
)
RESULT_SETTINGS = ("out", "resume", "tum", "json")
"""Settings that say where results go; only flags may set them, because a settings file may come from someone else."""
OMITTED_SETTINGS = (*RESULT_SETTINGS, "workers")
"""Settings that a run's config.yaml omits, because a repeat must not overwrite results and may use other workers."""
NO_DETECTOR = "--no-detector"
MAX_SETTINGS_BYTES, MAX_SETTINGS_DEPTH = 100_000, 8
"""Maximum size, bytes, and nesting depth of a settings file; a run's config.yaml has 6,400 bytes and 5 levels."""
Settings = TypeVar("Settings")


def run_with_settings(
    command: Callable[[Settings], object],
    kind: type[Settings],
    args: Sequence[str] | None = None,
    prog: str | None = None,
) -> None:
    """Run a command as :func:`sarsim.commands.cli.run` does; its flags are a dataclass's fields and ``--config``."""

    def run() -> None:
        words = apply_common_flags(args)
        about = getdoc(getattr(command, "func", command))
        settings = settings_from(kind, words, f"{about}\n\n{COMMON_FLAGS_HELP}", prog)
        check_names(vars(settings))
        command(settings)

    run_guarded(run)


def run_subcommand(commands: Mapping[str, tuple[Callable[[Any], object], type]], description: str) -> None:
    """Run the subcommand that the first word of the command line names, as :func:`run_with_settings` does."""
    name, *words = sys.argv[1:] or [""]
    if name in commands:
        run_with_settings(*commands[name], words, f"{program()} {name}")
        return
    kinds: dict[str, Callable[..., Any]] = {name: kind for name, (_, kind) in commands.items()}
    about = f"{description}\n\n{COMMON_FLAGS_HELP}"

    def run() -> None:
        if name and not name.startswith("-"):
            meant = "".join(f"; perhaps you meant {near}" for near in get_close_matches(name, commands, n=1))
            raise InputError(f"unknown subcommand {name!r}: must be one of {', '.join(commands)}{meant}")
        words = apply_common_flags()
        parse(lambda: tyro.extras.subcommand_cli_from_dict(kinds, prog=program(), args=words, description=about))

    run_guarded(run)


def settings_from(
    kind: type[Settings], args: Sequence[str], description: str | None = None, prog: str | None = None
) -> Settings:
    """The settings from ``args``; the defaults are those in the file that ``--config`` or ``--resume`` names, if any.

    Raises:
        InputError: a flag or the file is wrong.
    """
    own = [f.name.replace("_", "-") for f in fields(kind)]  # type: ignore[arg-type]
    args = _translate_no_detector(args) if "detector" in own else args
    asked: dict[str, list[str]] = {}
    if "plugins" in own:
        asked, args = split_flags(args, own)
        description = description and f"{description}\n\n{plugins_help()}"
    found = config_file(args)
    given = [*args, *(f"--{name}" for name in asked)]
    default: dict[str, Any] = {"default": load_settings(kind, found[1], given, found[0])} if found else {}
    flags = make_dataclass(
        "Flags",
        [
            ("settings", Annotated[kind, tyro.conf.arg(name="")], field(**default)),
            ("config", Annotated[Path | None, CONFIG], field(default=None)),
        ],
    )
    parser = partial(tyro.cli, flags, prog=prog or program(), description=description, args=args)
    settings = parse(partial(parser, config=(tyro.conf.SuppressFixed,))).settings
    for name, words_of in asked.items():
        one = partial(settings_of, name, words_of, settings.plugins.get(name))
        settings = replace(settings, plugins={**settings.plugins, name: parse(one)})
    return settings


def _translate_no_detector(args: Sequence[str]) -> list[str]:
    """The words of a command line, with ``--no-detector``, which tyro does not know, replaced by ``--detector None``.

    Raises:
        InputError: a detector is given as well.
    """
    given = {word.partition("=")[0].replace("_", "-") for word in args}
    if NO_DETECTOR in given and (chosen := given & {"--detector", "--detector-class"}):
        raise InputError(f"{NO_DETECTOR}: cannot be combined with {' or '.join(sorted(chosen))}")
    return [part for word in args for part in (("--detector", "None") if word == NO_DETECTOR else (word,))]


def config_file(args: Sequence[str]) -> tuple[str, Path] | None:
    """The flag that names a settings file, and this file; None if no flag does. ``--resume`` names the file's folder.

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


def load_settings(kind: type[Settings], path: Path, args: Sequence[str] = (), flag: str = "config") -> Settings:
    """Settings from a YAML file; ``tyro.MISSING`` for fields without a value in the file and in ``kind``.

    User code is accepted only as a flag in ``args``, because a file must not choose code to run.

    Raises:
        InputError: the file cannot be read, or contains an unknown key or a value of the wrong type, or
            sets a value that only a flag may set.
    """
    where = f"--{flag} {path}"
    content = _read_yaml(path, where)
    if not isinstance(content, dict):
        found = "but is empty" if content is None else f"not {content!r:.60}"
        raise InputError(f"{where}: must contain settings with their values, such as 'steps: 20', {found}")
    given = {str(key).replace("-", "_"): value for key, value in content.items()}
    if places := sorted(given.keys() & set(RESULT_SETTINGS)):
        raise InputError(f"{where}: a file must not set where results go; give --{places[0]} as a flag")
    on_command_line = {word.partition("=")[0].lstrip("-").replace("-", "_") for word in args if word.startswith("--")}
    for name in [name for name, value in given.items() if chooses_code(name.replace("_", "-"), value)]:
        if name not in on_command_line:
            raise InputError(
                f"{where}: a file must not choose code to run; give --{name.replace('_', '-')} as a flag"
            )
        del given[name]
    if isinstance(plugins := given.get("plugins"), dict):
        by_flag = {name for name in plugins if name in on_command_line and not may_be_in_file(name)}
        given["plugins"] = {name: own for name, own in plugins.items() if name not in by_flag}
    return _instance(kind, given, where)


def _instance(kind: type[Settings], given: Mapping[str, Any], where: str) -> Settings:
    """An instance of a dataclass with the values of a file; ``where`` begins the error messages."""
    from pydantic import TypeAdapter, ValidationError  # imported here, because --help does not need it

    hints = get_type_hints(kind, include_extras=True)
    values: dict[str, Any] = {}
    for name, value in given.items():
        if name not in hints:
            raise InputError(f"{where}: {_unknown([name], hints)}")
        if name == "plugins" and isinstance(value, dict):
            values[name] = {
                str(one): _instance(shipped_plugin(str(one), where).Settings, own or {}, f"{where}: plugins.{one}")
                for one, own in value.items()
            }
            continue
        # In JSON, unlike YAML, types are strict except for tuples and paths, and all numbers are finite.
        try:
            text = json.dumps(value, allow_nan=False, default=str)
            values[name] = TypeAdapter(hints[name]).validate_json(text, strict=True, extra="forbid")
        except ValidationError as error:
            raise InputError(f"{where}: {_complaint(kind, name, error.errors()[0])}") from None
        except (ValueError, TypeError) as error:
            raise InputError(f"{where}: {name}: {error}") from None
    required = [f.name for f in fields(kind) if f.default is MISSING and f.default_factory is MISSING]  # type: ignore[arg-type]
    return kind(**dict.fromkeys(required, tyro.MISSING) | values)


def _complaint(kind: Any, name: str, error: "ErrorDetails") -> str:
    """The message for an error in the setting ``name`` of a dataclass, with the path of the wrong value."""
    place, inner = [name], get_type_hints(kind)[name]
    for part in error["loc"]:
        if is_dataclass(inner):
            place.append(str(part))
            inner = get_type_hints(inner).get(str(part))
    if error["type"] == "unexpected_keyword_argument":
        owner = kind
        for part in place[:-1]:
            owner = get_type_hints(owner)[part]
        return _unknown(place, get_type_hints(owner))
    said = error.get("ctx", {}).get("error") or error["msg"]
    return f"{'.'.join(place)}: {error['input']!r:.60} is not a valid value: {said}"


def _unknown(place: Sequence[str], names: Collection[str]) -> str:
    """The message that there is no such setting, with the name of a similar setting, if there is one."""
    meant = "".join(f"; perhaps you meant {near}" for near in get_close_matches(place[-1], names, n=1))
    return f"unknown setting {'.'.join(place)}{meant}"


def _read_yaml(path: Path, where: str) -> Any:
    """The content of a YAML file; ``where`` begins the error messages.

    Raises:
        InputError: the file is too large, is nested too deeply, contains aliases or is not valid YAML.
    """
    try:
        text, depth = read_text(path, MAX_SETTINGS_BYTES), 0
        for event in yaml.parse(text):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent):
                raise InputError(f"{path}: aliases are not allowed; write out the value of *{event.anchor}")
            if depth > MAX_SETTINGS_DEPTH:
                raise InputError(f"{path}: settings must not be nested more than {MAX_SETTINGS_DEPTH} levels deep")
        return yaml.load(text, _UniqueLoader)
    except InputError as error:
        raise InputError(f"{where.partition(' ')[0]} {error}") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(f"{where}: not valid YAML: {' '.join(str(error).split())}") from error


class _UniqueLoader(yaml.SafeLoader):
    """Refuses a mapping with a repeated key, because PyYAML would silently take the last of its values."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """The mapping; ValueError if a key occurs twice."""
        keys = [key.value for key, _ in node.value]
        if twice := next((key for key in keys if keys.count(key) > 1), None):
            raise ValueError(f"the key {twice!r} occurs twice")
        return super().construct_mapping(node, deep)


class _Dumper(yaml.SafeDumper):
    """Writes paths as text, floats of NumPy as numbers, and equal values in full each time."""

    def ignore_aliases(self, data: object) -> bool:
        """Whether a repeated value is written in full."""
        return True


_Dumper.add_multi_representer(Path, lambda dumper, path: dumper.represent_str(str(path)))
_Dumper.add_multi_representer(float, yaml.SafeDumper.represent_float)


def save_settings(settings: Any, path: Path) -> None:
    """Write settings as YAML for ``--config``, without ``OMITTED_SETTINGS`` and paths that have their default value.

    Raises:
        InputError: the file cannot be written.
    """
    unchanged = {f.name for f in fields(settings) if "Path" in str(f.type) and getattr(settings, f.name) == f.default}
    saved = {name: value for name, value in asdict(settings).items() if name not in {*OMITTED_SETTINGS, *unchanged}}
    if plugins := getattr(settings, "plugins", None):
        saved["plugins"] = {name: value for name, value in saved["plugins"].items() if is_portable(plugins[name])}
    with atomic_write(path) as file:
        file.write_text(yaml.dump(saved, Dumper=_Dumper, sort_keys=False, default_flow_style=False))
