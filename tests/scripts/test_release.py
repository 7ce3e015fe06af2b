"""What a release is refused for, and its notes."""

import pytest

from scripts.release import RESULTS, changes, faults_of_dates, faults_of_results, faults_of_tag

CHANGELOG = "# Changelog\n\n## 0.2.0, 2027-01-02\n\n- New.\n\n- Newer.\n\n## 0.2.0rc1, not released yet\n\n- Old.\n"
CITATION = "version: 0.2.0\ndate-released: 2027-01-02\n"


def readme(*commits: str) -> str:
    rows = [f"| a | 1 m | – | b | [c](d), 2026-11-27, {commit} |\n" for commit in commits]
    head = "| what | here | peer | computed by | measured |\n|---|---|---|---|---|\n"
    return (
        f"# x\n\n| y | 2026-11-27, 0000000 |\n\n{RESULTS}\n\n## Results\n\n{head}{''.join(rows)}\n[All results](e)\n"
    )


def test_the_notes_are_the_changes_of_the_version() -> None:
    heading, notes = changes(CHANGELOG, "0.2.0")
    assert notes == "- New.\n\n- Newer."
    assert not faults_of_dates(heading, CITATION, "0.2.0")


def test_a_tag_names_the_version() -> None:
    assert not faults_of_tag("v0.2.0", "0.2.0")
    assert faults_of_tag("0.2.0", "0.2.0") and faults_of_tag("v0.2.1", "0.2.0")


@pytest.mark.parametrize("version", ["0.2.0rc1", "0.3.0"])
def test_a_version_without_a_date_is_refused(version: str) -> None:
    (fault,) = faults_of_dates(changes(CHANGELOG, version)[0], CITATION, version)
    assert "CHANGELOG.md" in fault and version in fault


@pytest.mark.parametrize("old", ["0.2.0", "2027-01-02"])
def test_the_citation_has_version_and_date(old: str) -> None:
    (fault,) = faults_of_dates(", 2027-01-02", CITATION.replace(old, "other"), "0.2.0")
    assert "CITATION.cff" in fault and old in fault


def test_all_results_must_be_of_one_commit() -> None:
    assert not faults_of_results(readme("f86fbd0d", "f86fbd0d"))
    for commits in (
        ["f86fbd0d", "9f38a35"],
        ["f86fbd0d+", "f86fbd0d+"],
        ["f86fbd0d", "not measured on this state yet"],
        [],
    ):
        (fault,) = faults_of_results(readme(*commits))
        assert "README.md" in fault
