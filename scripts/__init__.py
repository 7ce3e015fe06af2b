"""The commands; an installed copy has them as ``sarsim.scripts``."""
