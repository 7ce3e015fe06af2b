"""Many jobs, each independent of the others, on this machine or on a Ray cluster."""
