"""The page of a sweep: bands worked out by hand, and a page that is whole and safe."""

import re
from html import escape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sarsim.commands.sweeps.episodes import EpisodeResult
from sarsim.commands.sweeps.leaderboard import Entry, boards, entry_of
from sarsim.commands.sweeps.page import OKABE_ITO, band, write_page
from sarsim.scoring.progress import ExploredCurve

ABOUT = {"arenas": ("toys",), "seeds": (0, 1), "commit": "c", "version": "1", "processor": "P", "processor_s": 1.0}
PLACES = np.array([0.0, 9.0, 10.0, 99.0])
NOTHING = EpisodeResult.of_failure({}).curve


def curve(share: float) -> ExploredCurve:
    """Sees so much after 10 s and after 4 m."""
    return ExploredCurve(np.array([0.0, 10.0]), np.array([0.0, 4.0]), np.array([0.0, share]))


def test_episodes_that_are_alike_are_their_band_and_the_last_share_is_held() -> None:
    assert band([curve(0.6)] * 6, "time_s", PLACES, 2) == pytest.approx(np.tile([0, 0, 0.6, 0.6], (3, 1)))
    assert band([curve(0.6)] * 6, "way_m", np.array([3.9, 4.0]), 2) == pytest.approx(np.tile([0, 0.6], (3, 1)))


def test_a_band_is_the_middle_half_s_mean_and_what_is_left_of_all_draws_without_the_rarest() -> None:
    mean, low, high = band([curve(share) for share in (0.1, 0.3, 0.4, 1.0)], "time_s", PLACES[2:3], 2)
    assert mean == pytest.approx([0.35])  # without 0.1 and 1
    # Of two arenas, each with one share for all seeds, a quarter of all draws has one of them alone.
    mean, low, high = band([curve(share) for share in (0.2, 0.2, 0.8, 0.8)], "time_s", PLACES[2:3], 2)
    assert np.r_[mean, low, high] == pytest.approx([0.5, 0.2, 0.8])


def test_an_episode_that_failed_saw_nothing() -> None:
    assert band([curve(1.0), NOTHING, NOTHING, NOTHING], "time_s", PLACES, 1)[0].tolist() == [0, 0, 0, 0]


def row(arena: str, seed: int, **more: Any) -> dict[str, Any]:
    seen = {"explored_fraction": 0.6, "auc_time": 24.0, "auc_way": 9.6, "t90_s": 3.0}
    figures = {f"exploration.{key}": value for key, value in seen.items()}
    return figures | {"arena": arena, "seed": seed, "sim_time_s": 50.0, "navigation.distance_m": 20.0} | more


def entry(method: str) -> Entry:
    return entry_of([row(arena, seed) for arena in "ab" for seed in (0, 1)], **(ABOUT | {"method": method}))


def page(folder: Path, methods: list[str]) -> str:
    write_page([entry(m) for m in methods], {m: [curve(0.6)] * 4 for m in methods}, folder / "sweep.html")
    return (folder / "sweep.html").read_text()


def test_a_page_is_the_same_again_and_small_and_asks_for_nothing_from_elsewhere(tmp_path: Path) -> None:
    methods = [f"m{n}" for n in range(len(OKABE_ITO))]
    first = page(tmp_path, methods)
    assert page(tmp_path, methods) == first and len(first) < 300_000
    assert not re.search(r"<(script|link|img|iframe|image)\b|@import|url\((?!#)|(src|href)=\"(?!#)", first)


def test_names_are_shown_as_they_are_and_no_more(tmp_path: Path) -> None:
    class Tags(HTMLParser):
        def __init__(self, text: str) -> None:
            super().__init__()
            self.found: list[str] = []
            self.feed(text)

        def handle_starttag(self, tag: str, attrs: object) -> None:
            self.found.append(tag)

    names = ["m:<script>alert(1)</script>", 'm:"&</svg><!--', "m:$x_2$", "_m:$", "m:Ä"]
    text = page(tmp_path, names)
    assert Tags(text).found == Tags(page(tmp_path, ["m", "n", "o", "p", "q"])).found
    for name in names:
        assert text.count(escape(name).replace("&quot;", "&#34;")) == 2, name  # in the legend and in the table


def test_the_table_is_the_leaderboard_s(tmp_path: Path) -> None:
    (board,) = boards([entry("m"), entry("nearest_frontier")])
    text = page(tmp_path, ["m", "nearest_frontier"])
    assert re.findall("<th.*?>(.*?)</th>", text) == list(board.headings)
    assert re.findall("<td>(.*?)</td>", text) == [cell for row in board.rows for cell in row]
    assert board.title in text
