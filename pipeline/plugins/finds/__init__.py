"""Read and locate finds: the signs, codes, extinguishers, levers and heat that a robot looks for besides people."""
