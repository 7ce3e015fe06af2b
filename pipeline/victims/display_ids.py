"""Display ids of victims, the same in the report, the drawings and the log."""

from pipeline.tracks.track import Track
from pipeline.tracks.tracks import Tracks


def confirmed_ids(victims: Tracks) -> list[tuple[str, Track]]:
    """The confirmed victims with their ids: "1", "2", …"""
    return [(str(k), victim) for k, victim in enumerate(victims.confirmed, start=1)]


def unconfirmed_ids(victims: Tracks) -> list[tuple[str, Track]]:
    """The unconfirmed victims that are worth another look, with their ids: "A", "B", …"""
    return [(letters(k), victim) for k, victim in enumerate(victims.unconfirmed)]


def letters(k: int) -> str:
    """A, B, … Z, AA, AB, … for k = 0, 1, …"""
    head, last = divmod(k, 26)
    return (letters(head - 1) if head else "") + chr(ord("A") + last)
