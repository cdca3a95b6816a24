"""Exceptions of the package."""

from __future__ import annotations

__all__ = ["InputError", "Refused", "SagnacError"]


class SagnacError(Exception):
    """An error with a remedy.

    Attributes:
        reason: The cause.
        place: The place of the cause: file or table, row, column and value; empty where there is none.
        help: The remedy.
    """

    reason: str
    place: str
    help: str

    def __init__(self, reason: str, place: str, help: str) -> None:
        super().__init__(reason, place, help)
        self.reason = reason
        self.place = place
        self.help = help

    def __str__(self) -> str:
        text = f"{self.place}: {self.reason}" if self.place else self.reason
        return f"{text}\nhelp: {self.help}"


class InputError(SagnacError):
    """A bad argument, table or file (exit status 2 of the program)."""


class Refused(SagnacError):
    """The input is fine, but cannot support the answer (exit status 3 of the program)."""
