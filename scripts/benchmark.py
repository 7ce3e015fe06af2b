"""Benchmark the simulator and the pipeline against other software: ``benchmark.py SUBJECT [--json FILE]``."""

import importlib.metadata
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from importlib import import_module
from pathlib import Path

try:
    from rich.console import Console
except ModuleNotFoundError as error:
    raise SystemExit(
        f"error: {error.name} is not installed; run: make develop && source .venv/bin/activate"
    ) from None
from rich.markdown import Markdown

from pipeline.files import atomic_write
from sarsim.commands.cli import check_parent_folder, is_verbose
from sarsim.commands.provenance import instructions, machine, processor
from sarsim.commands.settings import run_subcommand, save_settings

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # scripts/ is not installed
from scripts.benchmarks.settings import SUBJECTS, SubjectSettings
from scripts.results import pages_config, table_of, tables_of


def benchmark(settings: SubjectSettings, subject: str) -> None:
    """Measure a subject, print the tables of its page, and write all figures to --json."""
    if settings.json:
        check_parent_folder("json", settings.json)
    result = import_module(f"scripts.benchmarks.{subject.replace('-', '_')}").measure(settings)
    words = result.details.get("words", {})
    tables = (
        [] if is_verbose() else tables_of(pages_config()["pages"].get(subject, {"tables": []}), result.figures, words)
    )
    tables = tables or [every_figure(subject, result.figures)]
    origin = f"{processor()}, {instructions()}"
    Console(markup=False).print(
        *(Markdown(text) for text in tables), *result.notes, origin, sep="\n", highlight=False
    )
    if settings.json:
        content = {
            "subject": subject,
            "version": importlib.metadata.version("sarsim"),
            "machine": machine(),
            "config": {name: value for name, value in asdict(settings).items() if name != "json"},
            "figures": result.figures,
            **result.details,
        }
        with atomic_write(settings.json) as part:
            part.write_text(json.dumps(content, indent=2, default=str) + "\n")
        save_settings(settings, settings.json.with_suffix(".yaml"))


def every_figure(subject: str, figures: Mapping[str, float]) -> str:
    """A table of all figures, as Markdown."""
    return table_of({"title": subject, "rows": {name: name for name in figures}}, figures)


def main() -> None:
    """Entry point."""
    run_subcommand({name: (partial(benchmark, subject=name), kind) for name, kind in SUBJECTS.items()}, str(__doc__))


if __name__ == "__main__":
    main()
