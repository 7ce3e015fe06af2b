"""As much of protocol buffers' wire format (protobuf.dev/programming-guides/encoding) as writing ONNX takes."""

import struct

_VARINT, _BYTES, _FIXED32 = 0, 2, 5


def varint(number: int) -> bytes:
    """A whole number of at least 0: seven bits a byte, the lowest first."""
    result = bytearray()
    while number > 0x7F:
        result.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*result, number])


def whole(field: int, number: int) -> bytes:
    """A field that holds a whole number of at least 0."""
    return varint(field << 3 | _VARINT) + varint(number)


def decimal(field: int, number: float) -> bytes:
    """A field that holds a float32."""
    return varint(field << 3 | _FIXED32) + struct.pack("<f", number)


def message(field: int, *parts: bytes) -> bytes:
    """A field that holds bytes, or a message of these fields."""
    content = b"".join(parts)
    return varint(field << 3 | _BYTES) + varint(len(content)) + content


def text(field: int, content: str) -> bytes:
    """A field that holds a string."""
    return message(field, content.encode())
