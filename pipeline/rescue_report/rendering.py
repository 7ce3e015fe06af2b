"""HTML and SVG from jinja2 templates, in which all inserted text is escaped."""

from base64 import b64encode
from io import BytesIO

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray
from PIL import Image

from pipeline import frame
from pipeline.arrays import Rgb
from pipeline.rescue_report import words


def environment(package: str) -> Environment:
    """The templates in the folder ``templates`` of a package; an undefined variable is an error."""
    loader = PackageLoader(package)
    return Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )


def png(rgba: NDArray[np.uint8]) -> str:
    """A (H, W, 4) uint8 RGBA image as a data URI of a PNG."""
    content = BytesIO()
    Image.fromarray(rgba).save(content, "PNG", optimize=True)
    return _data_uri("png", content.getvalue())


def jpeg(rgb: Rgb) -> str:
    """An image as a data URI of a JPEG."""
    return _data_uri("jpeg", frame.jpeg(rgb))


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:image/{kind};base64,{b64encode(data).decode()}"


TEMPLATES = environment("pipeline.rescue_report")
"""The rescue report's templates."""
for _filter in (
    png, jpeg, words.breakable, words.centimetres, words.counted, words.degrees, words.metres, words.minutes,
    words.number, words.percent, words.place, words.rotate, words.shown, words.side, words.slope, words.turn,
):  # fmt: skip
    TEMPLATES.filters[_filter.__name__] = _filter
