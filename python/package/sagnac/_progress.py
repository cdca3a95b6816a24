"""Progress of a fit: a callback, or a bar on a terminal and in a notebook."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ._errors import InputError

Watcher = Callable[[str, int, int], object]

#: Nothing is shown before this, s.
PATIENCE_S = 1.0
WIDTH = 24


@contextmanager
def watching(progress: Watcher | bool | None) -> Iterator[Watcher | None]:
    """The callback to give to the fit; what it has drawn is erased at the end."""
    if callable(progress):
        yield progress
        return
    if progress is not None and not isinstance(progress, bool):
        raise InputError("cannot be called", "progress", "give a callable, True or False")
    if progress is False or (progress is None and not (_is_terminal() or _is_notebook())):
        yield None
        return
    bar = Bar()
    try:
        yield bar
    finally:
        bar.erase()


def _is_terminal() -> bool:
    try:
        return sys.stderr is not None and sys.stderr.isatty()
    except (OSError, ValueError):
        return False


def _is_notebook() -> bool:
    return "ipykernel" in sys.modules


class Bar:
    """A line on standard error that is drawn over itself."""

    def __init__(self) -> None:
        self.since = time.monotonic()
        self.drawn = 0
        self.next = PATIENCE_S

    def __call__(self, what: str, done: int, of: int) -> None:
        passed = time.monotonic() - self.since
        if passed < self.next:
            return
        self.next = passed + 0.1
        full = WIDTH * done // max(of, 1)
        line = f"{what} [{'#' * full}{'.' * (WIDTH - full)}] {done} of {of}"
        self.write("\r" + line.ljust(self.drawn))
        self.drawn = len(line)

    def write(self, text: str) -> None:
        """A terminal that went away does not end a fit."""
        try:
            sys.stderr.write(text)
            sys.stderr.flush()
        except (AttributeError, OSError, ValueError):
            self.next = float("inf")

    def erase(self) -> None:
        if self.drawn:
            self.write("\r" + " " * self.drawn + "\r")
