"""Packages that are used when they are there."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ._errors import InputError


def need(name: str, for_what: str) -> Any:
    """A package.

    Raises:
        InputError: It is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        what = f"{for_what} need {name.split('.')[0]}, which is not installed"
        raise InputError(what, "", f"pip install {name.split('.')[0]}") from None
