"""The command ``sarsim``: all commands as subcommands, so that ``sarsim episode`` is ``sarsim-episode``."""

import ast
import sys
from difflib import get_close_matches
from importlib.metadata import EntryPoint, distribution, version
from importlib.util import find_spec
from pathlib import Path

from sarsim.commands.cli import BAD_INPUT

PREFIX = "sarsim-"


def main() -> None:
    """Entry point of ``sarsim``."""
    commands = {
        script.name.removeprefix(PREFIX): script
        for script in distribution("sarsim").entry_points.select(group="console_scripts")
        if script.name.startswith(PREFIX)
    }
    name, *words = sys.argv[1:] or ["--help"]
    if name in commands:
        sys.argv = [f"sarsim {name}", *words]
        commands[name].load()()
    elif name in ("-h", "--help"):
        print("usage: sarsim COMMAND [OPTIONS]\n")
        for command, script in sorted(commands.items()):
            print(f"  {command:<18}{_summary(script)}")
        print("\n'sarsim COMMAND --help' lists the command's options.")
    elif name == "--version":
        print("sarsim", version("sarsim"))
    else:
        meant = "".join(f"; perhaps you meant {near}" for near in get_close_matches(name, commands, n=1))
        print(f"error: {name}: must be one of {', '.join(sorted(commands))}{meant}", file=sys.stderr)
        sys.exit(BAD_INPUT)


def _summary(script: EntryPoint) -> str:
    """The summary of a command, from its module's docstring, without importing the command's dependencies."""
    found = find_spec(script.module)
    text = ast.get_docstring(ast.parse(Path(found.origin).read_text())) if found and found.origin else None
    return (text or "").partition("\n")[0].partition(": ``")[0].rstrip(".")


if __name__ == "__main__":
    main()
