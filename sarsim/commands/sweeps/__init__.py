"""Sweeps: many methods on the same arenas with the same seeds, and the leaderboard."""
