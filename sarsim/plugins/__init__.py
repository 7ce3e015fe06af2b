"""Parts of the simulated world, and commands, that a run asks for by name; nothing of the core imports them."""
