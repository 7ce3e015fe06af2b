"""QR codes and AprilTags as pictures."""

import cv2
import numpy as np
from numpy.typing import NDArray

TAG_DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
TAG_MODULES = 8  # Modules along a side of a tag's black square
TAG_SIDE = 0.16  # m, side of the black square of a tag on a wall
RESERVED_TAGS = 50  # Lower tag numbers are reserved for the tags that are used to score maps
QUIET_ZONE = 4  # Modules of white margin around a code, required by ISO/IEC 18004


def qr_modules(text: str) -> NDArray[np.uint8]:
    """(N, N) uint8, 0 or 255, the modules of a QR code without its white margin."""
    image = cv2.QRCodeEncoder.create().encode(text).astype(np.uint8)
    dark = np.argwhere(image == 0)
    (top, left), (bottom, right) = dark.min(axis=0), dark.max(axis=0) + 1
    return image[top:bottom, left:right]


def qr_picture(text: str) -> NDArray[np.uint8]:
    """(H, H) uint8 image of a QR code with its quiet zone; a module has 8 × 8 pixels."""
    quiet = np.pad(qr_modules(text), QUIET_ZONE, constant_values=255)
    return quiet.repeat(8, axis=0).repeat(8, axis=1)


def tag_picture(tag: int) -> NDArray[np.uint8]:
    """(160, 160) uint8 image of a tag with a white margin of one module; a module has 16 × 16 pixels."""
    black = cv2.aruco.generateImageMarker(TAG_DICTIONARY, tag, TAG_MODULES * 16)
    return np.pad(black, 16, constant_values=255)
