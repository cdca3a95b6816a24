"""Logs and the program that the package is compared with."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import polars
import pytest

ROOT = Path(__file__).parents[2]
CHAMBER = ROOT / "testdata/chamber"
MODEL = "bias 3, rate 0"

Program = Callable[..., bytes]


@pytest.fixture(scope="session")
def program() -> Program:
    """Runs `sagnac`; its standard output."""
    path = os.environ.get("SAGNAC_PROGRAM", os.fspath(ROOT / "target/debug/sagnac"))

    def run(*args: object, cwd: Path = CHAMBER) -> bytes:
        words = [path, *map(str, args)]
        done = subprocess.run(words, cwd=cwd, capture_output=True, check=False)
        assert done.returncode == 0, done.stderr.decode()
        return done.stdout

    return run


@pytest.fixture(scope="session")
def frames() -> list[polars.DataFrame]:
    """Two cycles and the retest in memory."""
    return [polars.read_csv(CHAMBER / f"{run}.csv.gz", infer_schema_length=None) for run in ("cycle-1", "cycle-2", "retest")]


@pytest.fixture()
def in_chamber(monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths as the program is given them: records hold them as they are."""
    monkeypatch.chdir(CHAMBER)
