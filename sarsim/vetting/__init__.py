"""Vets untrusted models of arenas and robots: checks their files, then compiles the models on trial before use."""
