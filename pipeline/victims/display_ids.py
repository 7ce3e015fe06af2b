"""What victims are called, wherever they are drawn or told of."""

from pipeline.victims.victim_map import Victim, Victims


def confirmed_ids(victims: Victims) -> list[tuple[str, Victim]]:
    """Those who are confirmed, by numbers from 1 on."""
    return [(str(k), victim) for k, victim in enumerate(victims.confirmed, start=1)]


def unconfirmed_ids(victims: Victims) -> list[tuple[str, Victim]]:
    """The others, by letters."""
    return [(letters(k), victim) for k, victim in enumerate(victims.unconfirmed)]


def letters(k: int) -> str:
    """A, B, … Z, AA, AB, … for k = 0, 1, …"""
    head, last = divmod(k, 26)
    return (letters(head - 1) if head else "") + chr(ord("A") + last)
