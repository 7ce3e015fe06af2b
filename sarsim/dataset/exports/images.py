"""Pictures as files."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray


def write_image(path: Path, image: NDArray, *options: int) -> None:
    """Write (H, W) or (H, W, 3) RGB as the kind of file that ``path`` ends in.

    Raises:
        OSError: it cannot be written.
    """
    bgr = image[..., ::-1] if image.ndim == 3 else image
    _, data = cv2.imencode(path.suffix, np.ascontiguousarray(bgr), options)
    path.write_bytes(data.tobytes())
