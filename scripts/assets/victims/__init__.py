"""The parts of the library of victims: body surfaces, and the poses in which ragdolls come to rest."""
