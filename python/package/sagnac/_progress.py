"""Progress of a fit: a callback, or a bar on a terminal and in a notebook."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

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
    if progress is False or (progress is None and not (sys.stderr.isatty() or _is_notebook())):
        yield None
        return
    bar = Bar()
    try:
        yield bar
    finally:
        bar.erase()


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
        sys.stderr.write("\r" + line.ljust(self.drawn))
        sys.stderr.flush()
        self.drawn = len(line)

    def erase(self) -> None:
        if self.drawn:
            sys.stderr.write("\r" + " " * self.drawn + "\r")
            sys.stderr.flush()
