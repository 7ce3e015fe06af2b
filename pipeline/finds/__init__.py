"""What a rescue robot looks for besides people: signs, codes, extinguishers, levers, heat; read and placed."""
