"""The exception for invalid input from the user."""


class InputError(ValueError):
    """Invalid input. The message is one line that says what is wrong and where; commands exit with status 2."""
