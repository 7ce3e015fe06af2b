"""Parts of the simulated world, and commands, that a run requests by name; no module of the core imports them."""
