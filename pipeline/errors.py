"""The exception for invalid input from the user, and errors as text."""


class InputError(ValueError):
    """Invalid input. The message is one line that says what is wrong and where; commands exit with status 2."""


def one_line(error: BaseException) -> str:
    """Type and message of an error, in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
