"""Objects to find other than people: signs, codes, tags, fire extinguishers and door levers."""
