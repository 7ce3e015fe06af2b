"""XML as Gazebo and MuJoCo read it, with tinyxml2, which accepts more than the standard allows.

Repaired are a bare ``&``, bytes that are not UTF-8, ``--`` in a comment, text before the declaration, missing spaces
between attributes, repeated attributes (the first is used), ``<`` in an attribute, prefixes without a namespace,
control characters, and anything after the root. What tinyxml2 rejects stays as it is: mismatched tags and values
without quotes. Document types and entities stay too, for the parser to reject.
"""

import re

_PARTS = {"<!--": "-->", "<![CDATA[": "]]>", "<?": "?>"}
"""Start and end markers of everything that is not an element."""
_NAME = r"[^\s<>/=\"'&!?]+"
_ATTRIBUTE = re.compile(rf"\s*({_NAME})\s*=\s*(\"[^\"]*\"|'[^']*')")
_TAG = re.compile(rf"<(/?)({_NAME})((?:{_ATTRIBUTE.pattern.replace('(', '(?:')})*)\s*(/?)>")
_BARE = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|#\d+|#x[0-9a-fA-F]+);)")
_CONTROL = re.compile("[\x01-\x08\x0b\x0c\x0e-\x1f]")
_NOT_UTF8 = re.compile("[\udc80-\udcff]")


def legible(content: bytes) -> str:
    """Repair what a strict parser would reject in a file's content but Gazebo and MuJoCo accept."""
    text = content.removeprefix(b"\xef\xbb\xbf").decode("utf-8", "surrogateescape")
    text = _CONTROL.sub(" ", _NOT_UTF8.sub(lambda byte: chr(ord(byte[0]) - 0xDC00), text))
    mended, place, depth = list[str](), 0, 0
    while (start := text.find("<", place)) >= 0:
        mended.append(_BARE.sub("&amp;", text[place:start]))
        begin = next((begin for begin in _PARTS if text.startswith(begin, start)), None)
        if begin is not None:
            end = text.find(_PARTS[begin], start + len(begin)) + len(_PARTS[begin])
            if end < start + len(begin):
                break
            if begin == "<![CDATA[":
                mended.append(text[start:end])
        elif (tag := _TAG.match(text, start)) is not None:
            mended.append(_mended(tag))
            end = tag.end()
            closing, *_, alone = tag.groups()
            depth += -1 if closing else not alone
            if depth <= 0:  # The root is closed
                return "".join(mended).strip()
        else:
            break
        place = end
    return "".join([*mended, text[max(place, start) :]]).strip()


def _mended(tag: re.Match[str]) -> str:
    closing, name, attributes, alone = tag.groups()
    values: dict[str, str] = {}
    for key, value in _ATTRIBUTE.findall(attributes):
        values.setdefault(key.replace(":", "."), _BARE.sub("&amp;", value).replace("<", "&lt;"))
    written = "".join(f" {key}={value}" for key, value in values.items())
    return f"<{closing}{name.replace(':', '.')}{written}{alone}>"
