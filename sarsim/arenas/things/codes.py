"""QR codes, as pictures and PNG files."""

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

QUIET = 4  # modules of white around a code, as ISO/IEC 18004 asks for


def qr_modules(text: str) -> NDArray[np.uint8]:
    """(N, N) uint8 the modules of a code without its white margin, 0 or 255."""
    image = cv2.QRCodeEncoder.create().encode(text)
    dark = np.argwhere(image == 0)
    (top, left), (bottom, right) = dark.min(axis=0), dark.max(axis=0) + 1
    return image[top:bottom, left:right]


def qr_picture(text: str, module: int = 8) -> NDArray[np.uint8]:
    """(H, H) uint8 a code with its quiet zone; a module has ``module`` × ``module`` pixels."""
    quiet = np.pad(qr_modules(text), QUIET, constant_values=255)
    return quiet.repeat(module, axis=0).repeat(module, axis=1)


@cache
def png(picture: bytes, side: int) -> bytes:
    """A square grey picture, its rows of ``side`` bytes, as the content of a PNG file in colours."""
    grey = np.frombuffer(picture, np.uint8).reshape(side, side)
    return cv2.imencode(".png", cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))[1].tobytes()
