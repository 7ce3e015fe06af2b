"""The signs of the map and of its legend; how they look stands in the page's style sheet."""

from pipeline.rescue_report.markup import Markup, element, joined

SIGNS = {
    "slope": joined(
        element("path", d="M-10 0H8M2 -6L9 0L2 6", class_="arrow-casing"),
        element("path", d="M-10 0H8M2 -6L9 0L2 6", class_="arrow"),
    ),
    "drop": element("rect", x=-14, y=-6, width=28, height=12, class_="drop"),
    "unseen": joined(
        element("path", d="M0 -13L13 0L0 13L-13 0z", class_="unseen"),
        element("text", "?", y=6, class_="unseen-mark"),
    ),
    "entrance": joined(
        element("circle", r=15, class_="entrance"),
        element("path", d="M12 0L-8 8L-3 0L-8 -8z", class_="heading"),
    ),
    "person": joined(
        element("circle", r=13, class_="person"), element("text", "1", y=6, class_="person-mark")
    ),
    "sighting": joined(
        element("circle", r=13, class_="sighting"), element("text", "A", y=6, class_="sighting-mark")
    ),
    "way": joined(
        element("path", d="M-15 0H15", class_="casing"), element("path", d="M-15 0H15", class_="way")
    ),
    "rest": element("path", d="M-15 0H15", class_="rest"),
    "looks": element("path", d="M-9 0h0M0 0h0M9 0h0", class_="looks"),
    "unknown": element("rect", x=-14, y=-8, width=28, height=16, class_="unknown box"),
}
"""Signs of the drawing around (0, 0)."""


def swatch(kind: str) -> Markup:
    """A small picture of a sign for the legend: see ``SIGNS``."""
    return element("svg", SIGNS[kind], viewBox="-16 -16 32 32", class_="swatch", aria_hidden="true")


def patterns() -> Markup:
    """Fillings for what is unknown and for drops."""
    size = {"patternUnits": "userSpaceOnUse", "patternTransform": "rotate(45)"}
    unseen = joined(
        element("rect", width=12, height=12, fill="#f4f4f2"), element("path", d="M0 0V12", class_="hatch")
    )
    tape = joined(
        element("rect", width=6, height=6, fill="#ffd400"), element("path", d="M0 0V6", class_="tape")
    )
    return element(
        "defs",
        element("pattern", unseen, id="hatched", width=12, height=12, **size),
        element("pattern", tape, id="taped", width=6, height=6, **size),
    )
