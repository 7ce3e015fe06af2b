"""HTML and SVG as text in which everything from outside is escaped."""

from base64 import b64encode
from html import escape

import cv2
import numpy as np
from numpy.typing import NDArray

_VOID = {"br", "img"}
"""Elements of HTML that have no end."""


class Markup(str):
    """Text that is HTML or SVG already."""

    __slots__ = ()


def element(name: str, *content: object, **attributes: object) -> Markup:
    """An element around some content.

    Args:
        name: of the element.
        content: markup as it is, anything else as text.
        attributes: by name, with ``_`` for ``-`` and a last one dropped: ``class_``, ``stroke_width``.
    """
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(str(value))}"' for key, value in attributes.items()
    )
    if name in _VOID:
        return Markup(f"<{name}{given}>")
    return Markup(f"<{name}{given}>{joined(*content)}</{name}>")


def joined(*content: object) -> Markup:
    """Markup as it is and anything else as text, one behind the other."""
    return Markup("".join(c if isinstance(c, Markup) else escape(str(c)) for c in content))


def png(rgba: NDArray[np.uint8]) -> str:
    """(H, W, 4) uint8 RGBA as a data URI without loss."""
    return _data_uri("png", rgba[..., [2, 1, 0, 3]], [cv2.IMWRITE_PNG_COMPRESSION, 9])


def jpeg(rgb: NDArray[np.uint8], quality: int = 88) -> str:
    """(H, W, 3) uint8 RGB as a data URI."""
    return _data_uri("jpeg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])


def _data_uri(kind: str, image: NDArray[np.uint8], settings: list[int]) -> str:
    _, data = cv2.imencode(f".{kind}", image, settings)
    return f"data:image/{kind};base64,{b64encode(data.tobytes()).decode()}"
