"""Untrusted models of arenas and robots: checked as files, then on trial, before anything is built of them."""
