"""What a release is refused for, and its notes."""

import pytest

from scripts.release import RESULTS, checked

CHANGELOG = "# Changelog\n\n## 0.2.0, 2027-01-02\n\n- New.\n\n- Newer.\n\n## 0.2.0rc1, not released yet\n\n- Old.\n"
CITATION = "version: 0.2.0\ndate-released: 2027-01-02\n"


def readme(*commits: str) -> str:
    measured = " and ".join(f"on 2026-11-27 at commit {commit}" for commit in commits)
    table = "| figure | sarsim | baseline | page |\n|---|---|---|---|\n| a | 1 m | – | [c](d) |\n"
    return f"# x\n\nMade on 2026-11-26 at commit 0000000.\n\n{RESULTS}\n\n{table}\nMeasured {measured}. [All](e)\n"


GOOD = {
    "tag": "v0.2.0",
    "version": "0.2.0",
    "changelog": CHANGELOG,
    "citation": CITATION,
    "readme": readme("f86fbd0d"),
}


def test_the_notes_are_the_changes_of_the_version() -> None:
    assert checked(**GOOD) == ("- New.\n\n- Newer.", [])
    assert checked(**GOOD | {"readme": readme("f86fbd0d", "f86fbd0d")})[1] == []


@pytest.mark.parametrize(
    ("change", "file"),
    [
        ({"tag": "0.2.0"}, "tag 0.2.0"),
        ({"tag": "v0.2.1"}, "tag v0.2.1"),
        ({"version": "0.2.0rc1", "tag": "v0.2.0rc1"}, "CHANGELOG.md"),
        ({"version": "0.3.0", "tag": "v0.3.0"}, "CHANGELOG.md"),
        ({"citation": CITATION.replace("0.2.0", "0.1.0")}, "CITATION.cff"),
        ({"citation": CITATION.replace("2027", "2026")}, "CITATION.cff"),
        ({"readme": readme("f86fbd0d", "9f38a35")}, "README.md"),
        ({"readme": readme("f86fbd0d+", "f86fbd0d+")}, "README.md"),
        ({"readme": readme("f86fbd0d").replace("1 m", "not measured yet")}, "README.md"),
        ({"readme": readme()}, "README.md"),
    ],
)
def test_a_release_is_refused_for_one_reason(change: dict[str, str], file: str) -> None:
    (fault,) = checked(**GOOD | change)[1]
    assert fault.startswith(file)
