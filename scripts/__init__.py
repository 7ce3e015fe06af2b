"""The commands of a checkout; some of these scripts only call commands that are modules of sarsim."""
