"""The arena that ``--arena`` names, which a user-defined function may build."""

import inspect

from pipeline.errors import InputError
from sarsim.arenas.arena import RescueArena
from sarsim.arenas.load import checked_arena, load_arena, refuse_placements
from sarsim.arenas.settings import RandomArenaConfig, StartPose, WorldVictims
from sarsim.methods.names import OWN_FUNCTION, load_own
from sarsim.settings import is_own_arena


def make_arena(
    name: str,
    start: StartPose | None = None,
    random: RandomArenaConfig | None = None,
    seed: int = 0,
    victims: WorldVictims | None = None,
) -> RescueArena:
    """The arena with a given name.

    Args:
        name: a name that :func:`~sarsim.arenas.load.load_arena` accepts, MODULE:FUNCTION, or an entry point, NAME or
            NAME/PART.
        start: start pose of the robot; by default the arena's own start, or else the best position in the arena.
        random: settings of a random arena.
        seed: seed for a user-defined function.
        victims: settings of the victims in an arena built from a file.

    Raises:
        InputError: as in :func:`~sarsim.arenas.load.load_arena`; or the function does not exist, or does not return
            an arena.
    """
    if is_own_arena(name):
        refuse_placements(name, victims or WorldVictims())
        whole, _, part = (name, "", "") if ":" in name else name.partition("/")
        build = load_own("arena", whole, OWN_FUNCTION)
        if not callable(build):
            raise InputError(f"--arena {name}: must name a function, not a {type(build).__name__}")
        wanted = inspect.signature(build).parameters
        built = build(**{key: value for key, value in {"seed": seed, "part": part}.items() if key in wanted})
        return checked_arena(built, f"--arena {name}", start)
    return load_arena(name, start, random, victims)
