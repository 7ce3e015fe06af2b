"""The one exception that means "the user gave something that cannot work"."""


class InputError(ValueError):
    """Bad input. The message is one line that says what is wrong and where; commands exit with status 2."""
