"""Self-contained HTML pages from jinja2 templates, in which all inserted text is escaped."""

from base64 import b64encode
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray
from PIL import Image

from pipeline import frame
from pipeline.arrays import Rgb
from pipeline.files import atomic_write


def render(package: str, template: str, filters: Sequence[Callable[..., str]] = (), **content: Any) -> str:
    """The text of a template in the folder ``templates`` of a package; an undefined variable is an error.

    Args:
        package: name of the package.
        template: name of the file.
        filters: functions that templates may call by their names as filters, in addition to ``png`` and ``jpeg``.
        **content: variables of the template.
    """
    environment = Environment(
        loader=PackageLoader(package),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {each.__name__: each for each in (png, jpeg, *filters)}
    return environment.get_template(template).render(content)


def write_html(path: Path, html: str) -> None:
    """Write a page; InputError if it cannot be written."""
    with atomic_write(path) as partial:
        partial.write_text(html, encoding="utf-8")


def png(rgba: NDArray[np.uint8]) -> str:
    """An (H, W, 4) uint8 RGBA image as a data URI of a PNG."""
    content = BytesIO()
    Image.fromarray(rgba).save(content, "PNG", optimize=True)
    return _data_uri("png", content.getvalue())


def jpeg(rgb: Rgb) -> str:
    """An image as a data URI of a JPEG."""
    return _data_uri("jpeg", frame.jpeg(rgb))


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:image/{kind};base64,{b64encode(data).decode()}"
