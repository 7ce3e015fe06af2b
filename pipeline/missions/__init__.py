"""Missions: what a robot is to do next, by which rules, and the files that it hands in at the end."""
