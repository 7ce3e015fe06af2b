"""Check that a tag can be released, and print the release notes: ``release.py v0.1.0``.

The script needs no installed package.
"""

import re
import tomllib
from argparse import ArgumentParser
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DATE = r"\d{4}-\d\d-\d\d"
RESULTS = "<!-- results: written by make results -->"
"""Text that marks the beginning of README's results."""
NOT_MEASURED = "not measured yet"
MEASURED = re.compile(rf"\bon {DATE} at commit ([0-9a-f]{{7,40}}\+?)(?=[ .])")
"""Pattern of the commit at which a part of README's results was measured."""


def main() -> None:
    """Entry point: print the notes, or print all errors to stderr and exit with status 1."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("tag", help="tag to be released, such as v0.1.0")
    tag = parser.parse_args().tag
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    texts = [(ROOT / name).read_text() for name in ("CHANGELOG.md", "CITATION.cff", "README.md")]
    notes, wrong = checked(tag, version, *texts)
    if wrong:
        raise SystemExit("\n".join(f"error: {fault}" for fault in wrong))
    print(notes)


def checked(tag: str, version: str, changelog: str, citation: str, readme: str) -> tuple[str, list[str]]:
    """The notes of a version, and the errors in its tag, its date, its citation and README's results."""
    wrong = []
    if tag != f"v{version}":
        wrong.append(f"tag {tag}: pyproject.toml has version {version}, so the tag must be v{version}")
    # CHANGELOG and CITATION must have the same date.
    found = re.search(rf"^## {re.escape(version)}, ({DATE})\n((?:(?!## ).*\n?)*)", changelog, re.MULTILINE)
    if found:
        wanted = f"version: {version}", f"date-released: {found[1]}"
        missing = [line for line in wanted if line not in citation.splitlines()]
        wrong += [f"CITATION.cff: must contain the line '{line}'" for line in missing]
    else:
        wrong.append(f"CHANGELOG.md: must have a heading with the release date, such as '## {version}, 2026-11-27'")
    # Every row of the results must be measured, and all on one commit without changes.
    results = readme.partition(RESULTS)[2]
    commits = MEASURED.findall(results) + ["none"] * (NOT_MEASURED in results)
    if len({commit[:7] for commit in commits}) != 1 or commits[0].endswith("+"):
        sources = ", ".join(dict.fromkeys(commits)) or "none"
        wrong.append(f"README.md: all results must come from one commit, not {sources}; run 'make results'")
    return (found[2].strip() if found else ""), wrong


if __name__ == "__main__":
    main()
