"""Gymnasium tasks; importing this package registers them: ``gym.make("sarsim.tasks:sarsim/Explore-v0")``."""

import gymnasium

gymnasium.register("sarsim/Explore-v0", entry_point="sarsim.tasks.explore:Explore")
gymnasium.register("sarsim/Drive-v0", entry_point="sarsim.tasks.drive:Drive")
