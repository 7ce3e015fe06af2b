"""What ``--arena`` names, also a function of the user's own."""

from sarsim.arenas.arena import RescueArena
from sarsim.arenas.load import checked_arena, load_arena
from sarsim.arenas.settings import RandomArenaConfig, StartPose, WorldVictims
from sarsim.methods.make import own_arena
from sarsim.settings import is_own_arena


def make_arena(
    name: str,
    start: StartPose | None = None,
    random: RandomArenaConfig | None = None,
    seed: int = 0,
    victims: WorldVictims | None = None,
) -> RescueArena:
    """The arena of that name.

    Args:
        name: as :func:`~sarsim.arenas.load.load_arena` takes it, MODULE:FUNCTION, or an entry point.
        start: where to set the robot down; if not given, the arena's own start, or else the best place in it.
        random: settings of a random arena.
        seed: for a function of the user's own.
        victims: settings of the victims of a world of others.

    Raises:
        InputError: as by :func:`~sarsim.arenas.load.load_arena`, or the function fails or returns something else.
    """
    if is_own_arena(name):
        return checked_arena(own_arena(name, seed), f"--arena {name}", start)
    return load_arena(name, start, random, victims)
