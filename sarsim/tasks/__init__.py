"""Gymnasium tasks; importing this package registers them: ``gym.make("sarsim.tasks:sarsim/Explore2D-v0")``.

Sweeps use the 2D maps and their explorers without Gymnasium, which only the extra ``rl`` installs.
"""

from contextlib import suppress

with suppress(ModuleNotFoundError):
    import gymnasium

    gymnasium.register("sarsim/Explore2D-v0", entry_point="sarsim.tasks.explore_2d:Explore2D")
    gymnasium.register("sarsim/Explore-v0", entry_point="sarsim.tasks.explore:Explore")
    gymnasium.register("sarsim/Drive-v0", entry_point="sarsim.tasks.drive:Drive")
