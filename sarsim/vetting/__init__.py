"""Untrusted models of arenas and robots: their files are checked, then compiled on trial, before they are used."""
