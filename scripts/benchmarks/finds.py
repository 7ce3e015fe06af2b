"""Finds: the fraction of each kind that the robot finds and reads in complete episodes, or that it finds in photos.

A folder of photos has ``truth.json`` and the folders ``arena/``, with boards named ``board<number>_<distance>cm``,
``people/`` and ``rooms/``. Only the photos in ``people/`` show people.
"""

import json
import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pipeline.errors import InputError
from pipeline.files import read_text
from pipeline.frame import decoded
from pipeline.plugins.finds.readers import FindReaders
from pipeline.tracks.find import FIND_KINDS, VICTIM, Reading
from pipeline.victims.boxes import pairwise_iou
from pipeline.victims.detection import Detection, Detector
from pipeline.victims.detector import VictimDetector
from sarsim.commands.cli import tracked
from sarsim.plugins.finds.plugin import shipped_readers
from scripts.benchmarks.common import Result
from scripts.benchmarks.runs import failures, jobs_of, run_episode, run_jobs
from scripts.benchmarks.settings import FindsSettings

HIGH_CONFIDENCE, LOW_CONFIDENCE = 0.5, 0.25  # Minimum confidences of a detected box
MIN_REFERENCE_CONFIDENCE, MIN_RELATIVE_SIDE = 0.6, 0.15
"""Minimum confidence of a scored reference box, and minimum ratio of its longer side to the photo's longer side."""
MATCHING_IOU = 0.5  # Intersection over union of a detected and a reference box above which a person is found
BOARD = re.compile(r"board(\w+)_(\d+)cm")
ENDINGS = (".jpg", ".jpeg", ".png")


def measure(settings: FindsSettings) -> Result:
    """Fractions found and read, false alarms per episode and position errors by kind, or the figures of photos.

    Raises:
        InputError: a network is broken, or a folder cannot be used.
    """
    if settings.photos is not None:
        return Result(photo_figures(settings.photos, VictimDetector.load(*settings.detector), shipped_readers()))
    jobs = list(jobs_of(replace(settings.episode, plugins={"finds": None}), settings))
    results = run_jobs(jobs, settings, run_episode)
    figures = figures_of([result for result in results if result and "report" in result])
    return Result(figures, {"failed": failures(jobs, results)})


def figures_of(results: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Figures by kind, such as the fraction ``found`` of the visible objects and ``read`` of the found objects."""
    figures = {"runs": float(len(results))}
    for kind in (VICTIM, *FIND_KINDS):
        reports = [r["report"]["victims"] if kind == VICTIM else r["report"]["finds"].get(kind) for r in results]
        present = [report for report in reports if report]
        visible, found = (sum(report[key] for report in present) for key in ("visible", "found"))
        if present:
            figures[f"{kind}.visible"] = float(visible)
            figures[f"{kind}.false_alarms"] = sum(report["false_alarms"] for report in present) / len(present)
        if visible:
            figures[f"{kind}.found"] = sum(report["visible_found"] for report in present) / visible
        if found and kind != VICTIM:
            figures[f"{kind}.read"] = sum(report["read"] for report in present) / found
        errors = [r["position_errors"] if kind == VICTIM else r["find_errors"].get(kind, []) for r in results]
        if every := [error for some in errors for error in some]:
            figures[f"{kind}.position_error_m.median"] = float(np.median(every))
    return figures


def photo_figures(folder: Path, detector: Detector, readers: FindReaders) -> dict[str, float]:
    """All figures ``real.*``; figures for which the photos show no object are left out.

    Raises:
        InputError: the folder, a photo or truth.json is missing or broken.
    """
    truth = _truth(folder)
    score = PhotoScore()
    photos = [path for kind in ("arena", "people", "rooms") for path in sorted((folder / kind).glob("*"))]
    photos = [path for path in photos if path.suffix.lower() in ENDINGS]
    for path in tracked(photos, "photos"):
        rgb = decoded(path.read_bytes(), cv2.IMREAD_COLOR)[..., ::-1].copy()
        detections = detector.detect(rgb)
        people = [found for found in detections if found.kind == VICTIM]
        readings = readers.read_image(rgb, detections)
        if path.parent.name == "people":
            score.add_people(people, truth["people"].get(path.name, {}).get("coco_person", ()), max(rgb.shape))
        else:
            score.add_empty(people)
        board = BOARD.fullmatch(path.stem) if path.parent.name == "arena" else None
        if board is not None and board[1] in truth["boards"]:
            score.add_board(readings, truth["boards"][board[1]], board[2])
        elif path.parent.name != "arena":
            score.add_without_signs(readings)
    return {"real.images": float(len(photos))} | score.figures()


class PhotoScore:
    """Counts, by figure, the objects found in photos, and the objects that could have been found."""

    def __init__(self) -> None:
        self._hits, self._totals = defaultdict[str, int](int), defaultdict[str, int](int)

    def figures(self) -> dict[str, float]:
        """The fraction found, for every figure whose total is not zero."""
        return {f"real.{name}": self._hits[name] / number for name, number in self._totals.items() if number}

    def _add(self, name: str, hits: int, number: int) -> None:
        self._hits[name] += hits
        self._totals[name] += number

    def add_empty(self, people: Sequence[Detection]) -> None:
        """Add a photo without people; ``people`` are the people and dolls that were nevertheless detected."""
        for name, least in (("empty_alarms_50", HIGH_CONFIDENCE), ("empty_alarms_25", LOW_CONFIDENCE)):
            self._add(name, any(person.confidence >= least for person in people), 1)

    def add_people(self, people: Sequence[Detection], reference: Sequence[Sequence[float]], side: int) -> None:
        """Add a photo with people.

        Args:
            people: the people detected.
            reference: x, y, width and height of each true person, pixels, and a confidence.
            side: the photo's longer side, pixels.
        """
        clear = [
            (x, y, x + w, y + h)
            for x, y, w, h, sure in reference
            if sure >= MIN_REFERENCE_CONFIDENCE and max(w, h) >= MIN_RELATIVE_SIDE * side
        ]
        for name, least in (("people_found_50", HIGH_CONFIDENCE), ("people_found_25", LOW_CONFIDENCE)):
            found = np.array([p.box for p in people if p.confidence >= least], np.float64).reshape(-1, 4)
            hits = sum(bool((pairwise_iou(np.array([box]), found) > MATCHING_IOU).any()) for box in clear)
            self._add(name, hits, len(clear))

    def add_board(self, readings: Sequence[Reading], board: dict[str, Any], distance: str) -> None:
        """Add a photo of a board with known content, taken from a distance in cm."""
        signs = Counter(r.text for r in readings if r.kind == "hazmat_sign" and r.confidence >= HIGH_CONFIDENCE)
        found = min(signs.total(), len(board["hazmat"]))
        self._add(f"hazmat_found.{distance}cm", found, len(board["hazmat"]))
        self._add("hazmat_right", min(found, (signs & Counter(board["hazmat"])).total()), found)
        codes = len({r.text for r in readings if r.kind == "qr_code" and r.text})
        self._add(f"qr_read.{distance}cm", min(codes, board["qr"]), board["qr"])

    def add_without_signs(self, readings: Sequence[Reading]) -> None:
        """Add a photo that shows no hazmat sign."""
        self._add(
            "hazmat_false", any(r.kind == "hazmat_sign" and r.confidence >= HIGH_CONFIDENCE for r in readings), 1
        )


def _truth(folder: Path) -> dict[str, Any]:
    """The content of the boards and the people in the photos; InputError if either is missing."""
    file = folder / "truth.json"
    try:
        truth = json.loads(read_text(file))
        return {"boards": dict(truth["boards"]), "people": dict(truth["people"])}
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{file}: must contain a JSON object with the objects 'boards' and 'people' ({error!r})"
        ) from error
