"""Run the benchmarks of the results pages, and write these pages: ``results.py [PAGE ...]``."""

import json
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import date
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any

try:
    import tyro
except ModuleNotFoundError as error:
    raise SystemExit(
        f"error: {error.name} is not installed; run: make develop && source .venv/bin/activate"
    ) from None
import yaml

from pipeline.errors import InputError
from pipeline.files import atomic_write
from pipeline.rescue_report.figures import figure_text
from pipeline.rescue_report.figures import figures as flat
from sarsim.commands.provenance import machine, state_of_code
from sarsim.commands.settings import run_with_settings
from sarsim.flags import Given

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "results"
ENTRIES = FOLDER / "leaderboard"
README = ROOT / "README.md"
MARKERS = ("<!-- results: written by make results -->", "<!-- end of results -->")
GENERATED_NOTE = "Written by make results from pages.yaml and JSON"  # In every page
NOT_MEASURED = "not measured yet"
LEADERBOARD_PAGE = "leaderboard"
FOLDER_PLACEHOLDER = "FOLDER"  # Placeholder for a folder outside the checkout in the command of a page
DIGITS = 5  # Significant digits of a stored figure
LEADERBOARD = """\
The leaderboard compares methods of exploration on the same frozen arenas with the same seeds. Brackets hold 95%
intervals. [Sweeps](../sweeps.md) explains the columns, and how to enter a method of your own."""
INDEX = """\
These pages show what was measured of each part of the project: on which date, at which commit, and compared with
other software where there is any. They help you to judge what to expect. Each page names the command that repeats its
measurement."""

Record = Mapping[str, Any]
"""Figures by name, and how they were measured: date, commit, command, version, machine, processor_s."""


@dataclass(frozen=True)
class ResultsSettings:
    """Which pages to measure and write.

    Attributes:
        pages: names in docs/results/pages.yaml. By default all.
        again: measure again, with new episodes, even if figures for this state of the code exist.
        write: measure nothing, but write the pages from the figures that exist.
        flags: additional flags for the benchmark, such as --flags="--frames 8"; the page lists them.
        folder: folder that replaces FOLDER in the command of a page, such as a folder of .raf arenas; without it, the
            command is run without FOLDER.
        claims: write nothing; run the commands of README's section Reproduce, and report which of its claims hold.
    """

    pages: Annotated[tuple[str, ...], tyro.conf.Positional] = ()
    again: bool = False
    write: bool = False
    flags: str = ""
    folder: Given[Path] = None
    claims: bool = False


def results(settings: ResultsSettings) -> None:
    """Measure the pages that lack figures for this state of the code, and write all pages and README's table."""
    known = pages_config()["pages"]
    if settings.claims:
        check_claims()
        return
    if unknown := set(settings.pages) - known.keys():
        raise InputError(f"{', '.join(sorted(unknown))}: no such results page; use {', '.join(known)}")
    for name in () if settings.write else settings.pages or known:
        measure_page(name, known[name], settings)
        write_pages()
    write_pages()


def pages_config() -> dict[str, Any]:
    """The content of pages.yaml: the content and the measurement of each page, and README's rows and claims."""
    content: dict[str, Any] = yaml.safe_load((FOLDER / "pages.yaml").read_text())
    return content


def measure_page(name: str, page: Mapping[str, Any], settings: ResultsSettings) -> None:
    """Measure a page unless it has figures for this state of the code."""
    commit, old = state_of_code(), record_of(name)
    if old and old["commit"] == commit and not commit.endswith("+") and not settings.again:
        print(f"{name}: already measured at commit {commit}")
        return
    print(f"{name}: takes about {duration(page, old)}", flush=True)
    own = page["command"].format(commit=commit)
    if commit.endswith("+") or settings.again:
        delete_episodes(own)
    command, given = with_folder(f"{own} {settings.flags}".strip(), settings.folder)
    record = measure(command, ROOT / "runs" / "results" / name, {}, given) | {"commit": commit}
    for variant, environment in page.get("environments", {}).items():
        again = measure(command, ROOT / "runs" / "results" / f"{name}-{variant}", environment, given)
        record["figures"] |= {f"{variant}.{figure}": value for figure, value in again["figures"].items()}
    with atomic_write(FOLDER / f"{name}.json") as part:
        part.write_text(json.dumps(record, indent=1, sort_keys=True) + "\n")
    print(f"{name}: took {record['processor_s']} s of processor time", flush=True)


def with_folder(command: str, folder: Path | None) -> tuple[str, dict[str, str]]:
    """The command to run and to show, without FOLDER unless ``folder`` is given, and the replacement for FOLDER."""
    if folder is None:
        return command.replace(f" {FOLDER_PLACEHOLDER}", ""), {}
    if not folder.is_dir():
        raise InputError(f"--folder {folder}: must be a folder")
    return command, {FOLDER_PLACEHOLDER: str(folder.resolve())}


def delete_episodes(command: str) -> None:
    """Delete the finished episodes in the folder ``--runs`` of a command, which the command would not run again."""
    for folder in re.findall(r" --runs (\S+)", command):
        shutil.rmtree(ROOT / folder, ignore_errors=True)


def measure(
    command: str, folder: Path, environment: Mapping[str, str] = {}, given: Mapping[str, str] = {}
) -> dict[str, Any]:
    """The record of a command, without the commit; the command is a benchmark or an episode.

    Args:
        command: the command, as the page shows it.
        folder: folder in which the command leaves its files.
        environment: environment variables of the command, such as one that selects a library's instruction set.
        given: replacements for words of the command.

    Raises:
        InputError: the command failed.
    """
    benchmark = command.startswith("benchmark.py")
    if not benchmark:
        shutil.rmtree(folder, ignore_errors=True)  # an episode needs a new folder
    folder.mkdir(parents=True, exist_ok=True)
    output = ["--json", str(folder / "figures.json")] if benchmark else ["--out", str(folder)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    script, *flags = (given.get(word, word) for word in shlex.split(command))
    program = [sys.executable, str(ROOT / "scripts" / script), *flags, *output]
    if status := subprocess.call(program, cwd=ROOT, env=os.environ | environment):
        raise InputError(f"the command '{command}' failed with exit status {status}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    content = json.loads((folder / ("figures.json" if benchmark else "report.json")).read_text())
    return {
        "command": command,
        "date": date.today().isoformat(),
        "processor_s": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime),
        "version": content["version"],
        "machine": content.get("machine") or machine(),
        "figures": stored_figures(content["figures"] if benchmark else dict(flat("", content))),
        **({"words": content["words"]} if "words" in content else {}),
    }


def stored_figures(figures: Mapping[str, Any]) -> dict[str, float]:
    """The figures that are numbers, except settings, rounded to ``DIGITS``; leading dots are stripped from names."""
    numbers = {name.lstrip("."): value for name, value in figures.items() if isinstance(value, int | float)}
    return {name: float(f"{value:.{DIGITS}g}") for name, value in numbers.items() if not name.startswith("config")}


def record_of(name: str) -> Record | None:
    """The record of a page; None if the page has not been measured."""
    file = FOLDER / f"{name}.json"
    return json.loads(file.read_text()) if file.exists() else None


def write_pages() -> None:
    """Write every page of results and README's table from the figures that exist."""
    for file, text in generated_pages().items():
        with atomic_write(file) as part:
            part.write_text(text)


def generated_pages() -> dict[Path, str]:
    """The text of every file that is generated from figures."""
    content = pages_config()
    pages, records = content["pages"], {name: record_of(name) for name in content["pages"]}
    written = {FOLDER / f"{name}.md": page_text(name, page, records[name]) for name, page in pages.items()}
    before, _, rest = README.read_text().partition(MARKERS[0])
    parts = readme_parts(content, records)
    readme = "\n\n".join([before.rstrip(), MARKERS[0], *parts, MARKERS[1]]) + rest.partition(MARKERS[1])[2]
    written |= {FOLDER / "index.md": index_page(pages, records), README: readme}
    return written | {FOLDER / "leaderboard.md": leaderboard_page(tuple(sorted(ENTRIES.glob("*.json"))), LEADERBOARD)}


def readme_parts(content: Mapping[str, Any], records: Mapping[str, Record | None]) -> list[str]:
    """README's results and claims, as Markdown."""
    pages, board = content["pages"], leaderboard_record(tuple(sorted(ENTRIES.glob("*.json"))))
    rows = [readme_row(row, {**records, LEADERBOARD_PAGE: board}[row["page"]]) for row in content["readme"]]
    claims = [claim_row(c, pages[c["page"]], records[c["page"]]) for c in content["claims"]]
    return [
        "## Results",
        "\n".join(["| figure | sarsim | baseline | page |", "|---|---|---|---|", *rows]),
        f"{measured_at(records.get(row['page']) for row in content['readme'])} [All results](docs/results/index.md)",
        "## Reproduce",
        "`make claims` repeats the measurements of these pages and reports which claims hold.",
        "\n".join(["| claim | page | processor minutes | expected | measured |", "|---|---|---|---|---|", *claims]),
    ]


def index_page(pages: Mapping[str, Any], records: Mapping[str, Record | None]) -> str:
    """The page that lists all pages of results, as Markdown."""
    rows = ["| page | measured | takes |", "|---|---|---|"]
    for name, page in pages.items():
        when = f"{record['date']}, {record['commit']}" if (record := records[name]) else NOT_MEASURED
        rows.append(table_row([f"[{page['title']}]({name}.md)", when, duration(page, record)]))
    board = "The [leaderboard](leaderboard.md) compares methods of exploration."
    older = "[`earlier.md`](earlier.md) has older figures, [`tried.md`](../tried.md) those of rejected ideas."
    return markdown("Results", INDEX, "make results   # measure everything", "\n".join(rows), board, older)


@cache
def leaderboard_record(files: tuple[Path, ...]) -> Record:
    """The cells of the leaderboard, by the end of the table's title, the method and the column; cached."""
    from sarsim.commands.sweeps.leaderboard import boards, read_entry

    return {
        "figures": {
            f"{board.title.rpartition(': ')[2]}.{row[0]}.{head}": cell
            for board in boards(map(read_entry, files))
            for row in board.rows
            for head, cell in zip(board.headings, row, strict=True)
        }
    }


@cache
def leaderboard_page(files: tuple[Path, ...], about: str) -> str:
    """The page of the leaderboard, from the files of its entries, as Markdown; cached to read the files only once."""
    from sarsim.commands.sweeps.leaderboard import boards, read_entry

    parts = []
    for board in boards(map(read_entry, files)):
        rows = [
            table_row(board.headings),
            "|---" * len(board.headings) + "|",
            *(table_row(row) for row in board.rows),
        ]
        parts += [f"## {board.title}", "\n".join(rows)]
    command = "sarsim-sweep --arenas nist_6x4 --seeds 0 1 2   # run one of the tables again"
    return markdown("Results: leaderboard", about, command, *parts or [f"{NOT_MEASURED.capitalize()}."])


def page_text(name: str, page: Mapping[str, Any], record: Record | None) -> str:
    """A page as Markdown."""
    command = f"make results PAGE={name}   # about {duration(page, record)}"
    parts = [f"Results: {page['title']}", page["about"], command]
    if record is None:
        return markdown(*parts, f"{NOT_MEASURED.capitalize()}.")
    whole, done = displayed_command(page["command"]), displayed_command(record["command"])
    part = [f"The complete measurement is `{whole}`."] if done != whole else []
    every = f"All figures are in [{name}.json]({name}.json)."
    return markdown(
        *parts,
        f"{origin(record)} `{done}`.",
        *part,
        *tables_of(page, record["figures"], record.get("words", {})),
        every,
    )


def markdown(title: str, about: str, command: str, *parts: str) -> str:
    """A page with a title, an introduction, the command that makes it, and paragraphs or tables."""
    return "\n\n".join([f"# {title}", f"<!-- {GENERATED_NOTE} -->", about, f"```sh\n{command}\n```", *parts]) + "\n"


def origin(record: Record) -> str:
    """The start of a sentence about a measurement: date, commit, version and machine; the command follows."""
    machine = record["machine"]
    on = f"{machine['cores']} cores of {machine['processor']} ({machine['instructions']})"
    return f"Measured on {record['date']} at commit {record['commit']} (version {record['version']}) on {on} by"


def displayed_command(command: str) -> str:
    """A command as a page shows it: with its installed name, if it has one, and without the folder ``--runs``."""
    command = re.sub(r" --runs \S+", "", command)
    return (
        command.replace("run_episode.py", "sarsim-episode")
        if command.startswith("run")
        else f"python scripts/{command}"
    )


def tables_of(page: Mapping[str, Any], figures: Mapping[str, float], words: Mapping[str, str] = {}) -> list[str]:
    """The tables of a page that have figures, as Markdown."""
    return [text for table in page["tables"] if (text := table_of(table, figures, words))]


def table_of(table: Mapping[str, Any], figures: Mapping[str, float], words: Mapping[str, str] = {}) -> str:
    """A table of the rows that have a figure, as Markdown; empty if no row has a figure.

    The format ``cell``, filled in with the values of row and column, is the name of a figure or of one of the words.
    Instead of ``rows``, a table may have ``by``, an ending of names. It then has a row for each figure whose name has
    this ending, the lowest figure first.
    """
    columns, cell = table.get("columns", {table.get("unit", "value"): ""}), table.get("cell", "{row}")
    shown = {name: figure_text(value) for name, value in figures.items()} | dict(words)
    rows = []
    for label, row in table.get("rows", {}).items() if "by" not in table else rows_by(table["by"], figures):
        names = [cell.format(row=row, column=column) for column in columns.values()]
        if any(name in figures for name in names):
            rows.append(table_row([label, *(shown.get(name, "–") for name in names)]))
    heads = [table_row([table.get("title", "figure"), *columns]), "|---" * (1 + len(columns)) + "|"]
    return "\n".join([*heads, *rows]) if rows else ""


def rows_by(ending: str, figures: Mapping[str, float]) -> list[tuple[str, str]]:
    """The label and the row of each figure whose name has an ending; both are the name without the ending.

    The lowest figure comes first.
    """
    names = [name.removesuffix(f".{ending}") for name in figures if name.endswith(f".{ending}")]
    names.sort(key=lambda name: (figures[f"{name}.{ending}"], name))
    return [(name, name) for name in names]


def table_row(cells: Iterable[str]) -> str:
    """A row of a table in Markdown."""
    return f"| {' | '.join(cells)} |"


def readme_row(row: Mapping[str, str], record: Record | None) -> str:
    """A row of README's results: ``ours`` and ``baseline`` with figures in place of the fields in braces."""
    page = f"[{row['page']}](docs/results/{row['page']}.md)"
    figures = record["figures"] if record else {}
    try:
        return table_row([row["what"], *(filled(row.get(who, "–"), figures) for who in ("ours", "baseline")), page])
    except KeyError:
        return table_row([row["what"], f"{NOT_MEASURED}: `make results PAGE={row['page']}`", "–", page])


def measured_at(records: Iterable[Record | None]) -> str:
    """A sentence with the dates and commits of the measurements; empty if there are no records."""
    states = dict.fromkeys(f"on {record['date']} at commit {record['commit']}" for record in records if record)
    return f"Measured {' and '.join(states)}." if states else ""


def filled(text: str, figures: Mapping[str, float]) -> str:
    """A text with figures in place of ``{name:format}``; KeyError if a figure is missing."""
    return re.sub(r"\{([^:{}]+):([^{}]*)\}", lambda field: format(figures[field[1]], field[2]), text)


def claim_row(claim: Mapping[str, Any], page: Mapping[str, Any], record: Record | None) -> str:
    """A row of README's claims."""
    figures = record["figures"] if record else {}
    value = value_of(claim, figures, NOT_MEASURED)
    link = f"[{claim['page']}](docs/results/{claim['page']}.md)"
    return table_row([claim["claim"], link, f"{processor_seconds(page, record) / 60:.1f}", expected(claim), value])


def value_of(claim: Mapping[str, Any], figures: Mapping[str, float], otherwise: str) -> str:
    """The figure that a claim names, as text: yes or no for a claim that something is true."""
    if claim["figure"] not in figures:
        return otherwise
    value = figures[claim["figure"]]
    return ("no", "yes")[value == 1] if claim.get("is_true") else figure_text(value)


def expected(claim: Mapping[str, Any]) -> str:
    """The figures that a claim allows."""
    if claim.get("is_true"):
        return "yes"
    return f"≥ {claim['least']:g}" if "least" in claim else f"≤ {claim['most']:g}"


def check_claims() -> None:
    """Run the commands of all claims, report which claims hold, and exit with status 1 unless all claims hold."""
    content, commit, failed = pages_config(), state_of_code(), 0
    for name, group in groupby(content["claims"], lambda claim: claim["page"]):
        command, _ = with_folder(content["pages"][name]["command"].format(commit=commit), None)
        delete_episodes(command)
        figures = measure(command, ROOT / "runs" / "claims" / name)["figures"]
        for claim in group:
            failed += not holds(claim, figures)
            value = value_of(claim, figures, "missing")
            word = "holds" if holds(claim, figures) else "FAILS"
            print(f"{word}  {claim['claim']}: {value}, expected {expected(claim)}", flush=True)
    if failed:
        raise SystemExit(1)


def holds(claim: Mapping[str, Any], figures: Mapping[str, float]) -> bool:
    """Whether the figure that a claim names exists and is within its bounds."""
    figure = figures.get(claim["figure"], float("nan"))
    if claim.get("is_true"):
        return figure == 1
    return bool(claim.get("least", figure) <= figure <= claim.get("most", figure))


def duration(page: Mapping[str, Any], record: Record | None) -> str:
    """Processor time of a page, in words."""
    taken = processor_seconds(page, record)
    return f"{taken:.0f} s of processor time" if taken < 100 else f"{taken / 60:.0f} min of processor time"


def processor_seconds(page: Mapping[str, Any], record: Record | None) -> float:
    """Processor time of a page, s, from the last measurement if it was complete, otherwise from the plan."""
    whole = record and displayed_command(record["command"]) == displayed_command(page["command"])
    return float(record["processor_s"] if record and whole else 60 * page["minutes"])


def main() -> None:
    """Entry point."""
    run_with_settings(results, ResultsSettings)


if __name__ == "__main__":
    main()
