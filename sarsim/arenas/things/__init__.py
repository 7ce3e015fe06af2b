"""Things that a rescue robot looks for besides people: signs, codes, tags, fire extinguishers, door levers."""
