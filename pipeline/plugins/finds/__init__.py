"""Finds: the signs, codes, extinguishers, levers and heat that a robot looks for besides people, read and located."""
