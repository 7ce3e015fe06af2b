"""The sections of a Darknet ``.cfg``: ``[kind]`` and under it lines of ``key=value``."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from pipeline.errors import InputError


@dataclass(frozen=True)
class CfgSection:
    """One section.

    Attributes:
        kind: what stands in its brackets.
        where: file and line, for errors.
        settings: by key.
    """

    kind: str
    where: str
    settings: dict[str, str] = field(default_factory=dict)

    def error(self, message: str) -> InputError:
        """Of this section."""
        return InputError(f"{self.where}: [{self.kind}] {message}")

    def whole(self, key: str, default: int | None = None, least: int = 1) -> int:
        """A whole number of at least ``least``."""
        number = self._number(key, self._text(key, None if default is None else str(default)), int)
        if number < least:
            raise self.error(f"{key}={number}: at least {least}")
        return int(number)

    def flag(self, key: str) -> bool:
        """0, which is the default, or 1."""
        return self.word(key, ("0", "1"), "0") == "1"

    def word(self, key: str, known: Sequence[str], default: str | None = None) -> str:
        """One of some words."""
        text = self._text(key, default)
        if text not in known:
            raise self.error(f"{key}={text}: known are {', '.join(known)}")
        return text

    def wholes(self, key: str) -> list[int]:
        """Whole numbers with commas between them."""
        return [int(self._number(key, text, int)) for text in self._list(key)]

    def decimals(self, key: str) -> list[float]:
        """Numbers with commas between them."""
        return [self._number(key, text, float) for text in self._list(key)]

    def refuse_others(self, **only: str) -> None:
        """Refuse settings that would make another layer than those of YOLOv3: any but these values."""
        for key, value in only.items():
            self.word(key, (value,), value)

    def _text(self, key: str, default: str | None) -> str:
        text = self.settings.get(key, default)
        if text is None:
            raise self.error(f"{key} is missing")
        return text

    def _list(self, key: str) -> list[str]:
        return [text for text in self._text(key, None).replace(" ", "").split(",") if text]

    def _number(self, key: str, text: str, kind: type[int] | type[float]) -> float:
        try:
            return kind(text)
        except ValueError:
            what = "a whole number" if kind is int else "a number"
            raise self.error(f"{key}={text}: not {what}") from None


def read_sections(text: str, name: str) -> list[CfgSection]:
    """All sections of a text; ``name`` is what errors call it.

    Raises:
        InputError: a line that is neither a section's head nor a setting of one.
    """
    sections: list[CfgSection] = []
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.split("#")[0].strip()
        if not line or line.startswith(";"):
            continue
        where = f"{name}:{number}"
        key, equals, value = line.partition("=")
        if line.startswith("[") and line.endswith("]"):
            sections.append(CfgSection(line[1:-1].strip(), where))
        elif equals and sections:
            sections[-1].settings[key.strip()] = value.strip()
        else:
            raise InputError(f"{where}: neither [section] nor key=value: {line[:40]}")
    return sections
