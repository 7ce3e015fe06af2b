"""Labelled RGB-D datasets: scenes rendered along drives through arenas, and what other tools read of them."""
