"""The classes of hazmat signs, in the words that rescue teams use."""

HAZMAT_CLASSES = (
    "corrosive", "dangerous-when-wet", "explosive", "flammable", "flammable-gas", "flammable-liquid",
    "flammable-solid", "infectious-substance", "inhalation-hazard", "non-flammable-gas", "organic-peroxide",
    "oxidizer", "oxygen", "poison", "radioactive", "spontaneously-combustible",
)  # fmt: skip
"""In the order of the network's outputs; its last output is "no sign"."""
