"""Labelled RGB-D datasets: scenes rendered along drives through arenas, and exports for other tools."""
