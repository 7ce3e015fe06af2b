"""The commands of a checkout; some scripts only call commands that are modules of sarsim."""
