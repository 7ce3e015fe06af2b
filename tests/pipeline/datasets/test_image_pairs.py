"""Folders of images as recorders write them: which colour image belongs to which depth image, and when."""

from collections.abc import Callable, Iterable
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.datasets.image_pairs import image_pairs
from pipeline.errors import InputError

Name = Callable[[int], str]


def images(folder: Path, numbers: Iterable[int], name: Name = "{}.png".format) -> None:
    folder.mkdir(parents=True)
    for number in numbers:
        (folder / name(number)).touch()


def paired(folder: Path, fps: float | None = 10.0) -> list[tuple[str, str | None]]:
    pairs = image_pairs(folder, fps)
    assert [p.time for p in pairs] == sorted(p.time for p in pairs)
    return [(p.depth.stem, p.colour and p.colour.stem) for p in pairs]


@pytest.mark.parametrize(
    ("of_depth", "of_colour"),
    [
        ("{}.png", "{}.png"),
        ("{:06d}.png", "{}.jpg"),
        ("depth_{}.png", "rgb_{}.png"),
        ("frame-{:06d}.depth.png", "frame-{:06d}.color.jpg"),
        ("depth_848x480_{}.png", "color_1280x720_{}.PNG"),
        ("2024-05-01_cam0_{}.png", "2024-05-01_cam1_{}.png"),
    ],
)
def test_numbers_pair_images_and_say_their_order(of_depth: str, of_colour: str, tmp_path: Path) -> None:
    images(tmp_path / "depth", range(13), of_depth.format)
    images(tmp_path / "rgb", (k for k in range(13) if k != 5), of_colour.format)
    pairs = image_pairs(tmp_path, 10.0)
    assert [p.depth.name for p in pairs] == [of_depth.format(k) for k in range(13)]
    names = [None if p.colour is None else p.colour.name for p in pairs]
    assert names == [None if k == 5 else of_colour.format(k) for k in range(13)]
    np.testing.assert_allclose([p.time for p in pairs], np.arange(13) / 10)


def test_a_lost_image_leaves_its_time_empty(tmp_path: Path) -> None:
    numbers = [0, 5, 10, 20, 25]  # every fifth was kept, and that of 15 was lost
    images(tmp_path / "depth", numbers[1:])
    images(tmp_path / "color", numbers[:-1])
    pairs = image_pairs(tmp_path, 2.0)
    np.testing.assert_allclose([p.time for p in pairs], [0.5, 1, 2, 2.5])
    assert [p.colour is None for p in pairs] == [False, False, False, True]


@pytest.mark.parametrize(
    "name",
    [
        lambda k: f"{round(0.05 * k, 3)}.png",
        lambda k: f"{0.05 * k:.2f}.png",
        lambda k: f"frame {0.05 * k:.2f} m.png",
        lambda k: f"{round(33.3 * k)}.png",
        lambda k: f"{round(81234567 + 33333.3 * k)}.png",
        lambda k: f"1.2.{k}.png",
    ],
    ids=["str", "decimals", "blanks", "ms", "us", "version"],
)
def test_a_decimal_is_one_number(name: Name, tmp_path: Path) -> None:
    for kind in ("depth", "rgb"):
        images(tmp_path / kind, range(25), name)
        (tmp_path / kind / "._0.png").touch()
    pairs = image_pairs(tmp_path, 20.0)
    assert [p.depth.name for p in pairs] == [name(k) for k in range(25)]
    assert [p.colour and p.colour.name for p in pairs] == [name(k) for k in range(25)]
    np.testing.assert_allclose([p.time for p in pairs], np.arange(25) / 20, atol=0.05)


@pytest.mark.parametrize("name", ["{:04x}.png", "{0}{1}.png"])
def test_names_that_differ_in_more_than_numbers_have_no_order(name: str, tmp_path: Path) -> None:
    for kind in ("depth", "rgb"):
        images(tmp_path / kind, range(12), lambda k: name.format(k, "ab"[k // 6]))
    with pytest.raises(InputError, match=r"depth: the names \w+.png and \w+.png .* depth.txt"):
        paired(tmp_path)


@pytest.mark.parametrize("name", ["a {}.png", "a,b {}.png", "a #{}.png", "{} 1.png"])
def test_the_rest_of_a_line_is_the_name(name: str, tmp_path: Path) -> None:
    for kind in ("depth", "rgb"):
        images(tmp_path / kind, range(3), name.format)
        lines = [f"{k / 10}, {kind}/{name.format(k)}" for k in range(3)]
        (tmp_path / f"{kind}.txt").write_text("\n".join(["# time file", *lines]))
    assert paired(tmp_path) == [(name.format(k)[:-4], name.format(k)[:-4]) for k in range(3)]


def test_blanks_in_associations_and_content_instead_of_names(tmp_path: Path) -> None:
    for kind, kept in (("d", np.uint16), ("c", np.uint8)):
        (tmp_path / kind).mkdir()
        for k in range(3):
            cv2.imwrite(str(tmp_path / kind / f"no {k}.png"), np.ones((4, 5), kept))
    lines = [f"{k / 10} c/no {k}.png {k / 10} d/no {k}.png\n" for k in range(3)]
    (tmp_path / "associations.txt").write_text("".join(lines))
    assert [(p.depth, p.colour) for p in image_pairs(tmp_path, None)] == [
        (tmp_path / "d" / f"no {k}.png", tmp_path / "c" / f"no {k}.png") for k in range(3)
    ]


def test_names_without_numbers_pair_by_their_order_if_they_can(tmp_path: Path) -> None:
    for name in ("b", "a", "c"):
        images(tmp_path / name / "depth", range(3), lambda k: "xyz"[k] + ".png")
    images(tmp_path / "a" / "rgb", range(3), lambda k: "uvw"[k] + ".png")
    images(tmp_path / "b" / "rgb", range(2), lambda k: "uvw"[k] + ".png")
    assert paired(tmp_path / "a") == [("x", "u"), ("y", "v"), ("z", "w")]
    with pytest.raises(InputError, match="3 depth and 2 colour"):
        paired(tmp_path / "b")


def test_one_image_of_each_is_a_pair(tmp_path: Path) -> None:
    for kind in ("depth", "rgb"):
        images(tmp_path / kind, [7], (kind + "_{}.png").format)
    assert paired(tmp_path) == [("depth_7", "rgb_7")]


@pytest.mark.parametrize("depth_first", [True, False])
@pytest.mark.parametrize("name", ["associations.txt", "assoc.txt", "associate.txt"])
def test_associations_pair_images_as_they_say(name: str, depth_first: bool, tmp_path: Path) -> None:
    images(tmp_path / "depth", range(3))
    images(tmp_path / "rgb", range(10, 13))
    for kind, times in (("depth", (1.0, 2.0, 3.0)), ("rgb", (1.2, 2.2, 3.2))):
        first = 0 if kind == "depth" else 10
        lines = [f"{time} {kind}/{first + k}.png\n" for k, time in enumerate(times)]
        (tmp_path / f"{kind}.txt").write_text("".join(lines))
    rows = [("2.0 depth/1.png", "2.2 rgb/12.png"), ("1.0 depth/0.png", "1.2 rgb/11.png")]
    lines = [" ".join(row if depth_first else row[::-1]) for row in rows]
    (tmp_path / "assoc_gt.txt").write_text("1.0 rgb/10.png 1.0 0 0 0 0 0 0 1\n")
    (tmp_path / name).write_text("# made by associate.py\n" + "\n".join(lines) + "\n")
    assert paired(tmp_path, None) == [("0", "11"), ("1", "12")]
    assert [p.time for p in image_pairs(tmp_path, None)] == [1.0, 2.0]
    (tmp_path / name).write_text(f"{lines[0]}\n1.0 depth/0.png\n")
    with pytest.raises(InputError, match=f"{name}: line 2"):
        paired(tmp_path)


SINCE = 1403636579.763555584
UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("in_names", [True, False])
def test_times_since_1970_may_be_in_any_unit(unit: str, in_names: bool, tmp_path: Path) -> None:
    for kind, shift in (("depth", 0.0), ("rgb", 0.007)):
        stamps = [(SINCE + 0.1 * k + shift) * UNITS[unit] for k in range(12)]
        words = [f"{stamp:.6f}" if unit == "s" else f"{stamp:.0f}" for stamp in stamps]
        images(tmp_path / kind, range(12), [f"{word}.png" for word in words].__getitem__)
        if not in_names:
            (tmp_path / f"{kind}.txt").write_text("".join(f"{word} {kind}/{word}.png\n" for word in words))
    pairs = image_pairs(tmp_path, None)
    np.testing.assert_allclose([p.time - SINCE for p in pairs], 0.1 * np.arange(12), atol=1e-3)
    assert all(p.colour is not None and p.colour.stem[:9] == p.depth.stem[:9] for p in pairs)


@pytest.mark.parametrize(("unit", "said"), [(1.0, None), (1e3, "ms"), (1e6, "µs"), (1e9, "ns")])
@pytest.mark.parametrize("since", [0.0, 181.2])
def test_times_since_the_camera_was_switched_on_may_be_in_any_unit(
    unit: float, said: str | None, since: float, tmp_path: Path
) -> None:
    for kind in ("depth", "rgb"):
        images(tmp_path / kind, range(9))
        lines = [f"{(since + k / 30) * unit:.6f} {kind}/{k}.png\n" for k in range(9)]
        (tmp_path / f"{kind}.txt").write_text("".join(lines))
    notes: list[str] = []
    pairs = image_pairs(tmp_path, None, notes.append)
    np.testing.assert_allclose(np.diff([p.time for p in pairs]), 1 / 30, atol=1e-5)
    assert all(p.colour is not None and p.colour.stem == p.depth.stem for p in pairs)
    assert [f" {said}," in note for note in notes] == [True, True] * (said is not None)


def test_frame_numbers_in_lists_are_said_and_take_their_times_from_the_rate(tmp_path: Path) -> None:
    for kind in ("depth", "rgb"):
        images(tmp_path / kind, range(9))
    (tmp_path / "associations.txt").write_text("".join(f"{k} depth/{k}.png {k} rgb/{k}.png\n" for k in range(9)))
    notes: list[str] = []
    assert [p.time for p in image_pairs(tmp_path, None, notes.append)] == [*range(9)]
    assert len(notes) == 1 and "--fps" in notes[0]
    np.testing.assert_allclose([p.time for p in image_pairs(tmp_path, 30.0)], np.arange(9) / 30)


def test_times_that_no_unit_makes_plausible_are_refused(tmp_path: Path) -> None:
    for kind in ("depth", "rgb"):
        images(tmp_path / kind, range(3))
        (tmp_path / f"{kind}.txt").write_text("".join(f"{1e20 * k} {kind}/{k}.png\n" for k in range(3)))
    with pytest.raises(InputError, match=r"depth.txt: .* interval .* is 1e.20"):
        paired(tmp_path)


def test_lists_whose_times_are_all_the_same_take_them_from_the_rate(tmp_path: Path) -> None:
    for kind in ("depth", "rgb"):
        images(tmp_path / kind, range(11))
        (tmp_path / f"{kind}.txt").write_text("".join(f"0 {kind}/{k}.png\n" for k in range(11)))
    with pytest.raises(InputError, match="--fps"):
        paired(tmp_path, None)
    np.testing.assert_allclose([p.time for p in image_pairs(tmp_path, 5.0)], np.arange(11) / 5)
    assert paired(tmp_path) == [(str(k), str(k)) for k in range(11)]


@pytest.mark.parametrize("line", ["nan depth/0.png", "inf depth/0.png", "0.5", "now depth/0.png"])
def test_a_line_that_is_no_time_and_file_is_named(line: str, tmp_path: Path) -> None:
    images(tmp_path / "rgb", range(3))
    (tmp_path / "depth.txt").write_text(f"# t file\n0.0 depth/0.png\n{line}\n")
    with pytest.raises(InputError, match=r"depth.txt: line 3"):
        paired(tmp_path)


def test_an_image_that_is_listed_twice_counts_once(tmp_path: Path) -> None:
    for kind in ("depth", "rgb"):
        images(tmp_path / kind, range(3))
        (tmp_path / f"{kind}.txt").write_text("".join(2 * f"{k / 10} {kind}/{k}.png\n" for k in range(3)))
    assert paired(tmp_path) == [("0", "0"), ("1", "1"), ("2", "2")]


@pytest.mark.parametrize("own", ["keyframes.txt", "label.txt"])
def test_times_that_sarsim_wrote_are_in_seconds(own: str, tmp_path: Path) -> None:
    times = [3.125 * k for k in range(4)]
    for kind in ("depth", "rgb"):
        images(tmp_path / kind, range(4))
        lines = (f"{time} {kind}/{k}.png" for k, time in enumerate(times))
        (tmp_path / f"{kind}.txt").write_text("\n".join(lines))
    assert [pair.time for pair in image_pairs(tmp_path, None)] == [time / 1000 for time in times]
    (tmp_path / own).touch()
    assert [pair.time for pair in image_pairs(tmp_path, None)] == times
