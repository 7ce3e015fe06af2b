"""How the subjects compute their figures, by hand."""

import numpy as np
import pytest

from pipeline.tracks.find import Reading, box_corners
from pipeline.victims.detection import Detection
from sarsim.settings import EpisodeConfig
from scripts.benchmarks import barn, camera, exploration, finds, localisation, networks, semantic, victims
from scripts.benchmarks.reports import flat_figures, group_figures
from scripts.benchmarks.runs import Job
from scripts.benchmarks.settings import NetworksSettings
from scripts.benchmarks.victims import PeopleInFrame, ap50


def report(explored=1.0, seen90=None, time=100.0, collisions=0, tipped=0):
    return {
        "arena": "a",
        "config": {"steps": 9},
        "sim_time_s": time,
        "steps": 7,
        "timing_ms": {"sense": {"median": 5.0}},
        "navigation": {"collisions": collisions, "tipped": tipped},
        "exploration": {"explored_fraction": explored} | ({} if seen90 is None else {"t90_s": seen90}),
    }


def test_all_numbers_of_a_report_become_figures_but_not_its_settings():
    assert flat_figures(report(seen90=40.0)) == {
        "sim_time_s": 100,
        "steps": 7,
        "timing_ms.sense.median": 5,
        "navigation.collisions": 0,
        "navigation.tipped": 0,
        "exploration.explored_fraction": 1,
        "exploration.t90_s": 40,
    }


def test_the_worst_is_the_lowest_of_what_should_be_high_and_the_highest_of_what_should_be_low():
    figures = group_figures([report(0.9, collisions=2), report(0.5, collisions=1), report(1.0, seen90=30.0)])
    key = "exploration.explored_fraction"
    assert (figures[f"{key}.worst"], figures[f"{key}.median"]) == (0.5, 0.9)
    assert figures[f"{key}.mean"] == pytest.approx(0.8)
    assert (figures["navigation.collisions.worst"], figures["navigation.collisions.sum"]) == (2, 3)
    assert figures["exploration.t90_s.mean"] == 30  # of the one run that has it


@pytest.mark.parametrize(
    ("ours", "theirs", "ratio"),
    [
        (report(seen90=30.0), report(seen90=60.0), 0.5),
        (report(seen90=30.0), report(time=90.0), None),  # they never did: nothing to compare with
        (report(time=50.0), report(seen90=25.0), 20.0),  # we never did: ten times our time
        (report(), report(), None),
    ],
)
def test_a_run_that_never_saw_enough_counts_against_us(ours, theirs, ratio):
    assert exploration.seen90_ratio(ours, theirs) == (None if ratio is None else pytest.approx(ratio))


def test_exploration_is_compared_by_pairs_that_both_completed():
    ours = [{"report": report(seen90=40.0)}, {"report": report(seen90=30.0)}, None]
    theirs = [{"report": report(seen90=80.0)}, {"report": report()}, {"report": report(seen90=9.0)}]
    figures = exploration.ratios({"ground_only.random": ours, "nearest_frontier.random": theirs}, ["random"])
    assert figures["seen90_vs_nearest_frontier"] == figures["random.seen90_vs_nearest_frontier.worst"] == 0.5
    assert figures["seen90_vs_nearest_frontier.pairs"] == figures["random.seen90_vs_nearest_frontier.pairs"] == 1
    found = exploration.figures_of("nearest_frontier.random", [*theirs, None])
    assert found["nearest_frontier.random.seen90_runs"] == 2 and found["nearest_frontier.random.failed"] == 1
    assert "nearest_frontier.random.timing_ms.sense.median.mean" not in found


def test_times_to_99_percent_are_compared_over_the_pairs_in_which_both_saw_it():
    def seen99(*times):
        reports = [report() for _ in times]
        for made, time in zip(reports, times, strict=True):
            made["exploration"] |= {} if time is None else {"t99_s": time}
        return [{"report": made} for made in reports]

    ours, theirs = seen99(30.0, 80.0, 50.0, None), seen99(60.0, 100.0, None, 40.0)
    figures = exploration.t99_ratio({"ground_only.random": ours, "nearest_frontier.random": theirs}, ["random"])
    found = {name.removeprefix("t99_vs_nearest_frontier."): value for name, value in figures.items()}
    assert (found["pairs"], found["only_ours"], found["only_theirs"]) == (2, 1, 1)
    assert found["value"] == pytest.approx((0.5 + 0.8) / 2)
    assert 0.5 <= found["low"] <= found["value"] <= found["high"] <= 0.8
    assert exploration.t99_ratio({"ground_only.random": ours}, ["random"]) == {}


def test_each_arena_has_the_figures_of_its_worst_run_and_why_it_ended():
    runs = [("a.raf", 0, 0.5), ("a.raf", 1, 0.4), ("random:3", 0, 1.0)]
    jobs = [Job("raf", EpisodeConfig(arena=arena, seed=seed)) for arena, seed, _ in runs]
    found = [{"report": report(explored)} for _, _, explored in runs]
    found[1]["report"]["exploration"]["ended"] = "not_worth_it"
    figures, words = exploration.arena_figures([*jobs, jobs[0]], [*found, None])
    assert figures["a.exploration.explored_fraction"] == 0.4
    assert figures["random:3.exploration.explored_fraction"] == 1.0
    assert words["a.exploration.ended"] == "not worth it"


def test_barn():
    reached, touched = {"ended": "reached", "seconds": 20.0}, {"ended": "contact", "seconds": 3.0}
    slow, late = {"ended": "reached", "seconds": 90.0}, {"ended": "time", "seconds": 100.0}
    found = barn.figures({"world_1": [reached, touched], "world_2": [slow, late]}, {"world_1": 5.0, "world_2": 6.0})
    assert (found["worlds"], found["success"], found["contacts"]) == (2, 0.5, 0.25)
    assert (found["world_1.success"], found["world_1.time_s"], found["world_1.score"]) == (0.5, 20.0, 0.125)
    assert (found["world_2.time_s"], found["world_2.score"]) == (90.0, 0.0625)
    assert found["score.mean"] == pytest.approx(0.375 / 4)
    assert 0 <= found["score.low"] < found["score.mean"] < found["score.high"] <= 0.25
    nobody = barn.figures({"world_7": [touched, late]}, {"world_7": 5.0})
    assert "world_7.time_s" not in nobody and nobody["score.mean"] == nobody["score.high"] == 0


def test_a_renderer_is_compared_round_by_round():
    ours, theirs = [10.0, 20.0, 40.0], [30.0, 80.0, 100.0]
    times = {name: [{"frame": t, "part": t / 2} for t in theirs] for name in camera.CONTENDERS}
    times["ours"] = [{"frame": t, "part": t / 5} for t in ours]
    figures = camera.summary(times)
    assert figures["frame_vs_renderer"] == 3.0  # of 3, 4 and 2.5
    assert (figures["ours.frame_ms"], figures["ours.part_ms"], figures["renderer.part_ms"]) == (20, 4, 40)


def test_accuracy_has_the_agreed_names_and_means_over_arenas():
    accuracy = {"raf.a": 0.5, "raf.b": 0.7, "raf.a.dark": 0.25, "nist_6x4": 1.0}
    figures = semantic.accuracy_figures({name: {"network": {"miou_four": v}} for name, v in accuracy.items()})
    assert figures["miou_four.nist_6x4.network"] == 1 and figures["miou_four.raf.a.network.dark"] == 0.25
    assert figures["miou_four.raf_mean.network"] == pytest.approx(0.6)
    assert figures["miou_four.raf_mean.network.dark"] == 0.25
    one = {"pointnet.alone": {"frame": {"miou_four": 0.5, "wall": 1.0}, "voxels": {}, "fused": {"miou_four": 0.25}}}
    two = {"pointnet.alone": {"frame": {"miou_four": 0.7}, "voxels": {"wall": 0.4}, "fused": {"miou_four": 0.75}}}
    assert networks.group_figures("raf_mean.dark", [one, two]) == {
        "pointnet.miou_four.raf_mean.frame.alone.dark": pytest.approx(0.6),
        "pointnet.iou.wall.raf_mean.frame.alone.dark": 1.0,
        "pointnet.iou.wall.raf_mean.voxels.alone.dark": 0.4,
        "pointnet.miou_four.raf_mean.fused.alone.dark": 0.5,
    }


def test_random_arenas_are_labelled_without_raf_arenas_too(tmp_path):
    (tmp_path / "a.raf").touch()
    a, *others = [str(tmp_path / "a.raf"), *(f"random:{networks.FIRST_RANDOM + n}" for n in (0, 1))]

    def frames(**given):
        return networks.frames_by_group(NetworksSettings(raf=tmp_path, random=2, **given))

    assert frames(frames=5, raf_frames=3) == {
        "nist_6x4": {"nist_6x4": 5},
        "esogu_52x15": {"esogu_52x15": 5},
        "raf_mean": {a: 3},
        "random_mean": dict.fromkeys(others, 3),
    }
    without = frames(frames=5, raf_frames=0)
    assert (without["raf_mean"], without["random_mean"]) == ({}, dict.fromkeys(others, 5))
    assert not any(frames(frames=0, raf_frames=0).values())


def test_localisation_has_figures_of_groups_and_ratios_of_medians():
    ours = {"keyframe_ms": 10.0, "correction_ms": 5.0, "loops": 2, "false_loops": 1, "nees": 1.5}
    drives = [
        {"ours": {"ate_m": ate} | ours, "kiss_icp": {"ate_m": kiss, "frame_ms": ms}}
        for ate, kiss, ms in ((0.1, 0.2, 30.0), (0.2, 0.4, 30.0), (0.3, 1.5, 60.0))
    ]
    figures = localisation.figures_of("nist_6x4", drives) | localisation.overall(drives)
    assert figures["nist_6x4.runs"] == 3
    assert figures["nist_6x4.ours.ate_m.median"] == figures["nist_6x4.kiss_icp.ate_m.median"] / 2 == 0.2
    assert figures["nist_6x4.ours.ate_m.worst"] == 0.3
    assert figures["nist_6x4.kiss_icp_vs_ours"] == pytest.approx(2)
    assert figures["kiss_icp_vs_ours_time"] == 3
    assert (figures["ours.keyframe_ms"], figures["ours.correction_ms"]) == (10, 5)
    assert (figures["loops"], figures["false_loops"], figures["nees"]) == (6, 3, 1.5)


BOXES = np.array([(0, 0, 20, 20), (100, 0, 140, 20), (200, 0, 240, 40)], np.float64)


def people(found: list[int], area: int = 500) -> PeopleInFrame:
    """Three people, the second of whom is mostly hidden; some of them found."""
    return PeopleInFrame(
        boxes=BOXES,
        area=np.full(3, area),
        hidden=np.array([0.0, 0.7, 0.5]),
        found=BOXES[found],
        confidence=np.linspace(0.9, 0.6, len(found)),
    )


def test_a_person_mostly_hidden_need_not_be_found_and_does_not_count_if_found():
    assert ap50([people([0, 2])]) == ap50([people([0, 1, 2])]) == 1
    assert ap50([people([0])]) == 0.5
    assert np.isnan(ap50([people([0], area=399)]))


def victims_result(visible, found, alarms, errors, time):
    counts = {"present": 4, "found": found, "false_alarms": alarms, "visible": visible, "visible_found": found}
    made = {"victims": counts, "sim_time_s": time, "exploration": {"t90_s": time / 2}}
    return {"report": made, "position_errors": errors}


def test_shares_and_errors_are_of_all_victims_and_times_of_pairs():
    found = [victims_result(3, 3, 0, [0.1, 0.1, 0.4], 110.0), victims_result(1, 0, 1, [], 100.0), None]
    figures = victims.figures_of("random", found, [victims_result(0, 0, 0, [], 100.0)] * 3)
    assert figures["random.runs"] == 2
    assert figures["random.visible_found_share"] == 0.75
    assert figures["random.position_error_m.median"] == pytest.approx(0.1)
    assert figures["random.victims.false_alarms.mean"] == 0.5
    assert figures["random.sim_time_vs_without"] == pytest.approx(1.05)


def reading(kind: str, text: str, confidence: float = 1.0) -> Reading:
    return Reading(kind, text, box_corners((0, 0, 20, 20)), confidence)


def test_photos():
    score = finds.PhotoScore()
    board = {"hazmat": ["poison", "poison", "oxygen"], "qr": 1}
    signs = [reading("hazmat_sign", text) for text in ("poison", "oxygen", "oxygen", "explosive")]
    score.add_board([*signs, reading("hazmat_sign", "poison", 0.4), reading("qr_code", "a")], board, "50")
    score.add_board([reading("hazmat_sign", "poison"), reading("qr_code", "")], board, "150")
    reference = [(0, 0, 50, 100, 0.9), (200, 0, 50, 100, 0.5), (300, 0, 50, 59, 0.9), (400, 0, 100, 100, 0.6)]
    score.add_people([Detection((0, 0, 50, 90), 0.6), Detection((400, 0, 500, 100), 0.3)], reference, 400)
    for seen in ([], [Detection((0, 0, 9, 9), 0.3)] * 2, [Detection((0, 0, 9, 9), 0.5)], []):
        score.add_empty(seen)
    assert score.figures() == {
        "real.hazmat_found.50cm": 1.0,  # four reported, of three
        "real.hazmat_right": (2 + 1) / (3 + 1),  # as multisets
        "real.qr_read.50cm": 1.0,
        "real.hazmat_found.150cm": 1 / 3,
        "real.qr_read.150cm": 0.0,
        "real.people_found_50": 0.5,  # of those clear and large enough
        "real.people_found_25": 1.0,
        "real.empty_alarms_50": 0.25,
        "real.empty_alarms_25": 0.5,
    }


def test_shares_of_finds_are_over_all_episodes():
    kind = {"present": 3, "visible": 2, "found": 2, "visible_found": 1, "read": 1, "false_alarms": 1}
    one = {"visible": 1, "found": 1, "visible_found": 1, "false_alarms": 0}
    errors = {"position_errors": [0.1], "find_errors": {"hazmat_sign": [0.1, 0.3]}}
    figures = finds.figures_of([{"report": {"victims": one, "finds": {"hazmat_sign": kind}}, **errors}] * 2)
    assert figures["hazmat_sign.found"] == figures["hazmat_sign.read"] == 0.5
    assert figures["hazmat_sign.false_alarms"] == 1
    assert figures["hazmat_sign.position_error_m.median"] == pytest.approx(0.2)
    assert figures["victim.found"] == 1 and figures["victim.position_error_m.median"] == 0.1
    assert "qr_code.found" not in figures
