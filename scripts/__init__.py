"""The commands of a checkout; those of sarsim are its modules, which the files here call."""
