"""How the victims' library is made: a body's surface, and the poses in which ragdolls come to rest."""
