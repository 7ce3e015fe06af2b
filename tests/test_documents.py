"""Links and pictures in the documents lead somewhere."""

import re
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("[a-z]*/**/*.md")])
CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
TARGET = re.compile(r"\]\(<?([^)\s>]+)|^\[[^\]]+\]:\s*(\S+)|(?:src|href)=\"([^\"]+)\"", re.MULTILINE)
ELSEWHERE = re.compile(r"[a-z]+:|#")


def targets(text: str) -> list[str]:
    """Relative paths that a Markdown text links to or shows."""
    found = ["".join(match) for match in TARGET.findall(CODE.sub("", text))]
    return [unquote(target.partition("#")[0]) for target in found if not ELSEWHERE.match(target)]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(document: Path) -> None:
    broken = [t for t in targets(document.read_text()) if not (document.parent / t).exists()]
    assert not broken


def test_targets_are_found() -> None:
    text = '[a](a.md#part) ![b](b%20c.png "title") <img src="d.jpg"> [e](https://e.org) [f](#f) `[g](g)`\n[h]: h.md\n'
    assert targets(text) == ["a.md", "b c.png", "d.jpg", "h.md"]
