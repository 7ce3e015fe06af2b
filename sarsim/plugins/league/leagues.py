"""The scores of the rescue leagues, rule by rule, computed only from a mission's measurements.

Sources: Rescue Robot League, rules 2026D, as summarised by a team; Virtual Robot competition, draft rules of
18 January 2022; small league (RMRC), rule book of 2026. Where these leave something open, the docstring of the rule's
function states the assumption.
"""

from dataclasses import dataclass

from pipeline.plugins.league.brief import Penalties, Rewards

Rule = dict[str, float]
"""The figures from which one rule of a score is computed, and the rule's ``points``."""


@dataclass(frozen=True)
class LeagueRun:
    """Measurements of a run in the labyrinth.

    Attributes:
        coverage: fraction of the drivable ground that the 3D map shows.
        global_error: global error of the 3D map, m.
        extras: number of the properties RGB, normals and confidence that the 3D map has.
        present: number of objects in the arena that score as finds.
        right, wrong: numbers of finds that match an object, each object counted once, and of all other finds.
        localisation_error: mean position error of the right finds, m.
        is_autonomous: whether nobody drove the robot.
        resets: number of times that the robot was touched.
    """

    coverage: float
    global_error: float
    extras: int
    present: int
    right: int
    wrong: int
    localisation_error: float
    is_autonomous: bool = True
    resets: int = 0


@dataclass(frozen=True)
class VirtualRun:
    """Measurements of a run of virtual robots.

    Attributes:
        portals, discovered: numbers of portals in the arena, and of portals that the map shows.
        victims, right, wrong: numbers of victims in the arena, of victims near a mark, and of marks near no victim.
        living, right_living, wrong_living: numbers of living victims, of living victims marked as living with a robot
            parked beside them, and of marks of living victims near no living victim.
        contacts: number of contacts with living victims.
    """

    portals: int
    discovered: int
    victims: int
    right: int
    wrong: int
    living: int
    right_living: int
    wrong_living: int
    contacts: int = 0


@dataclass(frozen=True)
class SmallRun:
    """Measurements of a run in the small league's labyrinth.

    Attributes:
        codes: number of QR codes in the arena.
        read: number of codes that were read.
        placed: number of the codes read whose distances from the two nearest fiducials in the map are right.
        fiducials, shown: numbers of fiducials in the arena, and of fiducials that the map shows.
        is_autonomous: whether nobody drove the robot.
    """

    codes: int
    read: int
    placed: int
    fiducials: int
    shown: int
    is_autonomous: bool = True


def league_score(run: LeagueRun, rewards: Rewards, penalties: Penalties) -> dict[str, Rule]:
    """The score of the Rescue Robot League 2026D: (map + detections) · autonomy − resets.

    - map: ``coverage / (1 + global error) · bonus``. Assumed: errors in m, and a bonus of 1 plus ``extra`` per extra.
    - detections: ``DS / (1 + localisation error)``. Assumed: DS is a fixed number of points for each object found; a
      wrong find costs nothing, because the summary names no penalty.
    - autonomy: the sum of both × 5, or × 1 if teleoperated; this rule's points are the points that the factor adds.
    - resets: the summary names no penalty in the labyrinth.
    """
    bonus = 1 + rewards.extra * run.extras
    of_map = run.coverage / (1 + run.global_error) * bonus
    of_finds = rewards.detection * run.right / (1 + run.localisation_error)
    factor = rewards.autonomous if run.is_autonomous else rewards.teleoperated
    rules = {
        "map": {"coverage": run.coverage, "global_error_m": run.global_error, "bonus": bonus, "points": of_map},
        "detections": {
            "present": run.present,
            "right": run.right,
            "wrong": run.wrong,
            "localisation_error_m": run.localisation_error,
            "points": of_finds,
        },
        "autonomy": {"factor": factor, "points": (factor - 1) * (of_map + of_finds)},
        "resets": {"count": run.resets, "points": 0.0 - penalties.reset * run.resets},
    }
    return rules | {"total": {"points": sum(rule["points"] for rule in rules.values())}}


def virtual_score(run: VirtualRun, rewards: Rewards, penalties: Penalties) -> dict[str, Rule]:
    """The score of the Virtual Robot competition 2022, the sum of its rules.

    ``[β S + (1 − β) ((v_r − ½ v_w) / V + max(0, (2 v_ar − v_aw) / (2 V_a)))] α``. S is the fraction
    of portals discovered. V, v_r and v_w are the numbers of victims, right victims and wrong marks; V_a, v_ar and
    v_aw are the same numbers for living victims.
    Assumed: without victims, or without living victims, the respective summand is 0. A contact costs a fraction of
    the points that a living victim adds to both summands. All contacts together cost at most the points that the
    right living victims have added.
    """
    share = run.discovered / run.portals if run.portals else 0.0
    found = rewards.alpha * (1 - rewards.beta)
    of_victims = found * (run.right - penalties.wrong * run.wrong) / run.victims if run.victims else 0.0
    alive = (2 * run.right_living - run.wrong_living) / (2 * run.living) if run.living else 0.0
    of_one = found * (1 / run.victims + 1 / run.living) if run.living else 0.0
    lost = min(penalties.contact * run.contacts, run.right_living) * of_one
    rules: dict[str, Rule] = {
        "portals": {
            "present": run.portals,
            "discovered": run.discovered,
            "points": rewards.alpha * rewards.beta * share,
        },
        "victims": {"present": run.victims, "right": run.right, "wrong": run.wrong, "points": of_victims},
        "living": {
            "present": run.living,
            "right": run.right_living,
            "wrong": run.wrong_living,
            "points": found * max(0.0, alive),
        },
        "contacts": {"count": run.contacts, "points": 0.0 - lost},
    }
    return rules | {"total": {"points": sum(rule["points"] for rule in rules.values())}}


def small_score(run: SmallRun, rewards: Rewards) -> dict[str, Rule]:
    """The score of a run in the labyrinth of the small league (2026).

    Points are given for codes that were read, and for codes at the right distances from the fiducials. The sum is
    multiplied by ``rewards.reading_alone`` if the run was autonomous.

    Laps are not scored in mapping. Assumed: a reading scores if a code in the arena has its text, but only once.
    """
    codes, placed = rewards.reading * run.read, rewards.placed * run.placed
    factor = rewards.reading_alone if run.is_autonomous else 1.0
    rules: dict[str, Rule] = {
        "codes": {"present": run.codes, "right": run.read, "points": codes},
        "distances": {"fiducials": run.fiducials, "shown": run.shown, "right": run.placed, "points": placed},
        "autonomy": {"factor": factor, "points": (factor - 1) * (codes + placed)},
    }
    return rules | {"total": {"points": sum(rule["points"] for rule in rules.values())}}
