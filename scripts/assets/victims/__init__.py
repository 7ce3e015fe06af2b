"""The parts of the victims' library: bodies' surfaces, and the poses in which ragdolls come to rest."""
