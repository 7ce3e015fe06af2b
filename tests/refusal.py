"""What a command says when it cannot do what it was asked."""

from collections.abc import Callable

import pytest


def refusal(capsys: pytest.CaptureFixture[str], run: Callable[..., object], *args: object) -> str:
    """The only line on stderr of a command that ends with status 2."""
    with pytest.raises(SystemExit) as raised:
        run(*args)
    assert raised.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line
