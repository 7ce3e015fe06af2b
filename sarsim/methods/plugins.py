"""Finds installed plug-ins, assigns words of a command line to plug-ins, and creates plug-ins for a run."""

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from pipeline.errors import InputError
from sarsim.settings import EXPLORE, is_shipped

if TYPE_CHECKING:  # commands look for plug-ins before slow imports, which take seconds
    from pipeline.plugin import Plugin

FLAG_GROUPS = ("sarsim.reader", "sarsim.sensor", "sarsim.sink")
"""Entry point groups of the plug-ins that a flag ``--NAME`` can request."""
MISSION_GROUP = "sarsim.mission"


def installed(groups: Iterable[str] = FLAG_GROUPS) -> dict[str, EntryPoint]:
    """The entry points of plug-ins by name; nothing is imported."""
    return {entry.name: entry for group in groups for entry in entry_points(group=group)}


def plugins_help() -> str:
    """The installed plug-ins, for ``--help``."""
    names = ", ".join(f"--{name}" for name in sorted(installed()))
    missions = ", ".join(sorted(filter(str.isidentifier, installed([MISSION_GROUP]))))
    return f"Plug-ins: {names}; their flags begin with their name. Missions: {missions}."


def find(name: str, groups: Iterable[str] = FLAG_GROUPS) -> EntryPoint:
    """The entry point of a plug-in; InputError if it is not installed."""
    if entry := installed(groups).get(name):
        return entry
    raise InputError(f"--{name}: no such plug-in is installed{_remedy(name)}")


def find_mission(name: str) -> tuple[str, EntryPoint]:
    """The plug-in name and the entry point of the mission that ``--mission`` gives by name or file.

    Raises:
        InputError: there is no such mission.
    """
    entries = installed([MISSION_GROUP])
    entry = entries.get(name) or entries.get(Path(name).suffix)
    if entry is None:
        known = ", ".join([EXPLORE, *sorted(filter(str.isidentifier, entries))])
        raise InputError(f"--mission {name}: must be {known} or a YAML file{_remedy(name)}")
    return min(other.name for other in entries.values() if other.value == entry.value and other.name[0] != "."), entry


def _remedy(name: str) -> str:
    """The remedy, for a message, if the sources contain a plug-in that is not installed; empty otherwise."""
    project = Path(__file__).parents[2] / "pyproject.toml"
    groups = tomllib.loads(project.read_text())["project"].get("entry-points", {}) if project.is_file() else {}
    return "; run: make setup" if any(name in names for names in groups.values()) else ""


def load_object(entry: EntryPoint) -> Any:
    """The object that an entry point names; InputError if a package of its extras is missing."""
    try:
        return entry.load()
    except ModuleNotFoundError as error:
        if not entry.extras or entry.dist is None:
            raise
        remedy = f"pip install '{entry.dist.name}[{','.join(entry.extras)}]'"
        raise InputError(f"{entry.name} needs the package {error.name}; run: {remedy}") from None


def load(entry: EntryPoint) -> "type[Plugin]":
    """The class of a plug-in; InputError if the entry point is not a plug-in."""
    from pipeline.plugin import Plugin

    loaded = load_object(entry)
    if not (isinstance(loaded, type) and issubclass(loaded, Plugin)):
        flag = entry.group.removeprefix("sarsim.")
        raise InputError(f"--{entry.name}: not a plug-in, but a class or function; use --{flag} {entry.name}")
    return loaded


def split_flags(words: Sequence[str], own: Sequence[str]) -> tuple[dict[str, list[str]], list[str]]:
    """Split a command line into the words of each plug-in, as flags of its settings, and the remaining words.

    ``own``: names of the command's own flags, which take precedence.
    """
    asked: dict[str, list[str]] = {}
    rest, into, left = list[str](), list[str](), 0.0
    for word in words:
        flag, equals, _ = word.removeprefix("--").replace("_", "-").partition("=")
        owners = [name for name in installed() if flag == name or flag.startswith(f"{name}-")]
        if word.startswith("--") and owners and flag not in own:
            owner = max(owners, key=len)
            into = asked.setdefault(owner, [])
            into += [f"--{flag.removeprefix(f'{owner}-')}"] if flag != owner else []
            into += [word.partition("=")[2]] if equals else []
            positional = [f for f in fields(load(find(owner)).Settings) if "Positional" in str(f.type)]
            left = len(positional) if flag == owner and not equals else float("inf")
        elif word.startswith("--") or not left:
            rest.append(word)
            left = 0
        else:
            into.append(word)
            left -= 1
    return asked, rest


def settings_of(name: str, words: Sequence[str], default: Any = None) -> Any:
    """The settings of a plug-in from its words on the command line; ``default``: its settings in a file, if any."""
    kind, given = load(find(name)).Settings, {} if default is None else {"default": default}
    return tyro.cli(kind, args=list(words), prog=f"--{name}", config=(tyro.conf.SuppressFixed,), **given)


def is_portable(settings: Any) -> bool:
    """Whether a file may request a plug-in with these settings or this class of settings, because none is a path."""
    return not any("Path" in str(f.type) for f in fields(settings))


def may_be_in_file(name: str) -> bool:
    """Whether a file may request a plug-in: it is one of sarsim's own and writes nowhere but in the run's folder."""
    entry = find(name, (*FLAG_GROUPS, MISSION_GROUP))
    return is_shipped(name, entry.group) and is_portable(load(entry).Settings)


def shipped_plugin(name: str, where: str) -> "type[Plugin]":
    """The plug-in that a file requests; InputError, which begins with ``where``, if only a flag may request it."""
    entry = find(name, (*FLAG_GROUPS, MISSION_GROUP))
    if not is_shipped(name, entry.group):
        raise InputError(f"{where}: a file must not choose code to run; give --{name} as a flag")
    if not is_portable(load(entry).Settings):
        raise InputError(f"{where}: a file must not set where results go; give --{name} as a flag")
    return load(entry)


def make_plugins(command: Any, hooks: Sequence[str] = ()) -> "list[Plugin]":
    """The plug-ins that a command's settings request, each after the plug-ins that it needs.

    Args:
        command: settings of the command.
        hooks: for a command that is not a run with maps, the names of the methods that it calls; every plug-in must
            define one of them.

    Raises:
        InputError: a plug-in is not installed, its settings are not suitable, or the command has no use for it.
    """
    settings: Mapping[str, Any] = command.plugins
    made: dict[str, Plugin] = {}

    def make(name: str, entry: EntryPoint) -> None:
        if name not in made:
            kind = load(entry)
            if hooks and not any(hook in vars(cls) for hook in hooks for cls in kind.__mro__[:-2]):
                raise InputError(f"--{name}: this command has no use for it; leave it out")
            for needed in kind.needs:
                make(needed, find(needed))
            made[name] = kind(settings.get(name) or kind.Settings(), command)
            made[name].name = name

    for name in settings:
        if name not in installed([MISSION_GROUP]):
            make(name, find(name))
    mission = getattr(command, "mission", EXPLORE)
    if mission != EXPLORE:
        make(*find_mission(mission))
    return list(made.values())
