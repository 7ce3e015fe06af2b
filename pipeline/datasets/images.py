"""Decode the image messages of camera drivers."""

import struct
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Depth, Rgb
from pipeline.datasets.messages import Message
from pipeline.errors import InputError
from pipeline.frame import decoded

MILLIMETRE_ENCODINGS = ("16UC1", "mono16")  # Encodings of depth in mm (REP 118)
DEPTH_ENCODINGS = (*MILLIMETRE_ENCODINGS, "32FC1")  # Encodings of depth, of which the last is in m
TO_RGB = {
    "rgb8": (3, None),
    "bgr8": (3, cv2.COLOR_BGR2RGB),
    "rgba8": (4, cv2.COLOR_RGBA2RGB),
    "bgra8": (4, cv2.COLOR_BGRA2RGB),
    "8uc3": (3, cv2.COLOR_BGR2RGB),
    "8uc4": (4, cv2.COLOR_BGRA2RGB),
    "mono8": (1, cv2.COLOR_GRAY2RGB),
    "8uc1": (1, cv2.COLOR_GRAY2RGB),
    **dict.fromkeys(("yuv422_yuy2", "yuyv"), (2, cv2.COLOR_YUV2RGB_YUY2)),
    **dict.fromkeys(("yuv422", "uyvy"), (2, cv2.COLOR_YUV2RGB_UYVY)),
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2RGB),
    "bayer_grbg8": (1, cv2.COLOR_BayerGB2RGB),
    "bayer_bggr8": (1, cv2.COLOR_BayerRG2RGB),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2RGB),
}
"""By encoding: number of channels, and OpenCV's code that converts them to RGB.

OpenCV names Bayer patterns from pixel (1, 1).
"""
SIXTEEN_BIT = {"rgb16": "rgb8", "bgr16": "bgr8", "rgba16": "rgba8", "bgra16": "bgra8"}
"""Encodings with 16 bits per channel, and the encodings of the upper 8 bits."""
COMPRESSED_DEPTH_HEADER = struct.Struct("<iff")
"""Header of a depth image of compressed_depth_image_transport: a format and two parameters."""
PNG, JPEG = b"\x89PNG", b"\xff\xd8"  # First bytes of image files
UNREADABLE = "is damaged, too large or not supported"
LOSSLESS = "16-bit PNG or TIFF, 32-bit float TIFF, or compressedDepth"
MIN_CLIPPED_FRACTION = 0.01  # Minimum fraction of pixels with the depth that stands for no return
MIN_CLIP_GAP = 0.1  # Minimum gap below this depth, as a fraction of this depth
MIN_NO_RETURN = float(np.finfo(np.float16).max)
"""Value from which on floats stand for no return, such as 65504 in AirSim."""


def is_depth(message: Message) -> bool:
    """Whether an image holds depth, by its encoding or, if it is compressed, by its format or its content."""
    if not hasattr(message, "format"):
        return message.encoding in DEPTH_ENCODINGS
    if "compressedDepth" in message.format or message.format.startswith(DEPTH_ENCODINGS):
        return True
    try:
        pixels = decoded(message.data, cv2.IMREAD_UNCHANGED)
    except InputError:
        return False
    return pixels.ndim == 2 and pixels.dtype in (np.uint16, np.float32)


def depth_of(message: Message) -> Depth:
    """The depth in a depth image, m; InputError if the image is broken or not encoded as depth."""
    if hasattr(message, "format"):
        return _compressed_depth(message)
    if message.encoding in MILLIMETRE_ENCODINGS:
        return metres(_pixels(message, np.dtype(np.uint16), 1), 1000.0)
    if message.encoding == "32FC1":
        return metres(_pixels(message, np.dtype(np.float32), 1))
    raise InputError(
        f"depth images in {message.encoding!r} are not supported; use {', '.join(MILLIMETRE_ENCODINGS)} or 32FC1"
    )


def metres(pixels: NDArray, units: float = 1.0) -> Depth:
    """Depth, m, of an image, given its number of units per metre.

    Values that are not positive or not finite mean no return. The maximum of an integer type, and values of at least
    the maximum of half precision, also mean no return, because some drivers write these values instead.
    """
    nothing = np.iinfo(pixels.dtype).max if np.issubdtype(pixels.dtype, np.integer) else MIN_NO_RETURN
    is_return = (pixels > 0) & (pixels < nothing)
    return np.where(is_return, pixels / np.float32(units), 0).astype(np.float32)


def clip_of(depths: Sequence[Depth]) -> float | None:
    """The depth, m, that a recorder writes for no return, such as the far end of its range; None if not recognised.

    This depth is the largest in the images, frequent in most of them, a whole number of decimetres, and far above all
    other depths.
    """
    most = float(max((depth.max() for depth in depths), default=0.0))
    equal = np.array([np.mean(depth == np.float32(most)) for depth in depths])
    others = max((depth[depth < np.float32(most)].max(initial=0.0) for depth in depths), default=0.0)
    is_round = most > 0 and abs(10 * most - round(10 * most)) < 1e-4
    is_clip = is_round and np.median(equal) > MIN_CLIPPED_FRACTION and 0 < others < (1 - MIN_CLIP_GAP) * most
    return most if is_clip else None


def colour_of(message: Message) -> Rgb:
    """The pixels of a colour image; InputError if the encoding is unknown or the image is broken."""
    if hasattr(message, "format"):
        try:
            return np.ascontiguousarray(decoded(message.data, cv2.IMREAD_COLOR)[..., ::-1])
        except InputError as error:
            raise InputError(
                f"a colour image with format {message.format!r} {UNREADABLE}; use intact JPEG or PNG images"
            ) from error
    encoding = message.encoding.lower()
    if encoding not in (*TO_RGB, *SIXTEEN_BIT):
        accepted = f"{', '.join((*TO_RGB, *SIXTEEN_BIT))} or compressed images"
        raise InputError(f"colour images in {message.encoding!r} are not supported; use {accepted}")
    channels, code = TO_RGB[SIXTEEN_BIT.get(encoding, encoding)]
    if encoding in SIXTEEN_BIT:
        pixels = (_pixels(message, np.dtype(np.uint16), channels) >> 8).astype(np.uint8)
    else:
        pixels = _pixels(message, np.dtype(np.uint8), channels)
    return pixels.copy() if code is None else np.asarray(cv2.cvtColor(pixels, code), np.uint8)


def label_of(message: Message) -> NDArray[np.uint8]:
    """(H, W) labels of an ``8UC1`` or ``mono8`` image; InputError if it has another encoding or is broken."""
    if message.encoding not in ("8UC1", "mono8"):
        raise InputError(f"label images in {message.encoding!r} are not supported; use 8UC1 or mono8")
    return _pixels(message, np.dtype(np.uint8), 1).copy()


def _pixels(message: Message, kind: np.dtype, channels: int) -> NDArray:
    """(H, W) or (H, W, C) pixels of a raw image, whose rows may be padded and whose bytes may be swapped.

    Raises:
        InputError: the image is empty or truncated.
    """
    height, width, step = message.height, message.width, message.step
    row = width * channels * kind.itemsize
    size = f"{width} × {height} pixels in {message.encoding!r}"
    if not height or not width:
        raise InputError(f"empty image: {size}; width and height must be positive")
    if step < row:
        raise InputError(f"truncated rows: an image of {size} needs {row} bytes a row, not {step}")
    if len(message.data) < height * step:
        raise InputError(f"truncated image: {size} need {height * step} bytes, not {len(message.data)}")
    rows = message.data[: height * step].reshape(height, step)[:, :row]
    pixels = np.ascontiguousarray(rows).view(kind.newbyteorder(">" if message.is_bigendian else "<"))
    pixels = pixels.astype(kind, copy=False)
    return pixels.reshape(height, width, channels) if channels > 1 else pixels


def _compressed_depth(message: Message) -> Depth:
    """The depth in a losslessly compressed depth image, m.

    The message holds an image file of depth in mm or m, or a header of compressed_depth_image_transport followed by
    an image file. This file then contains depth in mm, or inverse depth scaled with the header's two parameters.

    Raises:
        InputError: the image is broken, lossy or of another type.
    """
    data, a, b, is_inverse = message.data, 0.0, 0.0, False
    if "compressedDepth" in message.format and len(data) > COMPRESSED_DEPTH_HEADER.size and data[:4].tobytes() != PNG:
        _, a, b = COMPRESSED_DEPTH_HEADER.unpack(data[: COMPRESSED_DEPTH_HEADER.size].tobytes())
        data, is_inverse = data[COMPRESSED_DEPTH_HEADER.size :], "32FC1" in message.format
    if data[:2].tobytes() == JPEG:
        lossy = "are not supported, because JPEG alters depth"
        raise InputError(f"depth images in {message.format!r} {lossy}; use {LOSSLESS}")
    try:
        pixels = decoded(data, cv2.IMREAD_UNCHANGED)
    except InputError as error:
        raise InputError(f"a depth image with format {message.format!r} {UNREADABLE}; use {LOSSLESS}") from error
    if pixels.ndim == 2 and pixels.dtype == np.float32:
        return metres(pixels)
    if pixels.ndim != 2 or pixels.dtype != np.uint16:
        kind = f"{pixels.dtype} pixels of shape {pixels.shape}"
        raise InputError(f"depth images in {message.format!r} with {kind} are not supported; use {LOSSLESS}")
    if not is_inverse:
        return metres(pixels, 1000.0)
    with np.errstate(divide="ignore"):
        return metres(np.float32(a) / np.where(metres(pixels) > 0, pixels - np.float32(b), np.inf))
