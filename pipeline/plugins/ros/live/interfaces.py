"""Installed ROS types, by name."""

import re
from importlib import import_module
from typing import Any


def interface(name: str) -> Any:
    """The class of a ROS type, ``package/msg/Name`` or ``package/action/Name``; None if it is not installed."""
    if not re.fullmatch(r"\w+/(msg|action)/\w+", name):
        return None
    package, kind, name = name.split("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), name)
    except ImportError:
        return None
