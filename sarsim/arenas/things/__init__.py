"""Things that a rescue robot looks for besides people: signs, codes, tags, extinguishers, levers."""
