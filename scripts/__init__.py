"""The commands of a checkout; sarsim's own commands are modules of sarsim, which the files here call."""
