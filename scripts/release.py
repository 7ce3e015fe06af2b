"""Check that a tag can be released, and print its notes: ``release.py v0.1.0``. It needs no installed package."""

import re
import tomllib
from argparse import ArgumentParser
from itertools import dropwhile, takewhile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DATE = r"\d{4}-\d\d-\d\d"
RESULTS = "<!-- results: written by make results -->"
"""Marks the beginning of README's results."""
ROW = re.compile(rf", {DATE}, ([0-9a-f]{{7,40}}\+?) \|$", re.MULTILINE)
"""The end of a row of README's results: date and commit of the measurement."""


def main() -> None:
    """Entry point: print the notes, or print all faults to stderr and exit with status 1."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("tag", help="tag to be released, such as v0.1.0")
    tag = parser.parse_args().tag
    version = tomllib.loads(text("pyproject.toml"))["project"]["version"]
    heading, notes = changes(text("CHANGELOG.md"), version)
    wrong = [
        *faults_of_tag(tag, version),
        *faults_of_dates(heading, text("CITATION.cff"), version),
        *faults_of_results(text("README.md")),
    ]
    if wrong:
        raise SystemExit("\n".join(f"error: {fault}" for fault in wrong))
    print(notes)


def text(name: str) -> str:
    """The text of a file of the checkout."""
    return (ROOT / name).read_text()


def changes(changelog: str, version: str) -> tuple[str, str]:
    """The rest of a version's heading in the changelog, and the text below it; empty if it has none."""
    found = re.search(rf"^## {re.escape(version)}\b(.*)\n((?:(?!## ).*\n?)*)", changelog, re.MULTILINE)
    return (found[1], found[2].strip()) if found else ("", "")


def faults_of_tag(tag: str, version: str) -> list[str]:
    """What is wrong with a tag."""
    return (
        []
        if tag == f"v{version}"
        else [f"tag {tag}: pyproject.toml has version {version}, so the tag must be v{version}"]
    )


def faults_of_dates(heading: str, citation: str, version: str) -> list[str]:
    """What is wrong with the dates of a version: CHANGELOG and CITATION must have the same one."""
    date = re.search(DATE, heading)
    if not date:
        return [f"CHANGELOG.md: must have a heading with the release date, such as '## {version}, 2026-11-27'"]
    wanted = f"version: {version}", f"date-released: {date[0]}"
    return [f"CITATION.cff: must contain the line '{line}'" for line in wanted if line not in citation.splitlines()]


def faults_of_results(readme: str) -> list[str]:
    """What is wrong with README's results: every row must be measured, and all on one commit without changes."""
    lines = iter(readme.partition(RESULTS)[2].splitlines())
    table = takewhile(lambda line: line.startswith("|"), dropwhile(lambda line: not line.startswith("|"), lines))
    rows = list(table)[2:]  # without the header and the line below it
    commits = [found[1] if (found := ROW.search(row)) else "none" for row in rows]
    if not rows:
        return ["README.md: has no results table; run 'make results'"]
    if len({commit[:7] for commit in commits}) == 1 and ROW.search(rows[0]) and not commits[0].endswith("+"):
        return []
    sources = ", ".join(f"{commit} ({commits.count(commit)})" for commit in dict.fromkeys(commits))
    return [
        f"README.md: all results must come from one commit without changes (+), not {sources}; run 'make results'"
    ]


if __name__ == "__main__":
    main()
