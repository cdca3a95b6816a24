"""An import is quick: it brings nothing along that few of its users need."""

from __future__ import annotations

import importlib.metadata
import subprocess
import sys

import sagnac

#: Each takes as long to import as the package itself, or longer.
HEAVY = ["importlib.metadata", "matplotlib", "numpy", "pandas", "polars", "pyarrow"]


def test_an_import_brings_nothing_heavy_along() -> None:
    code = f"import sys, sagnac; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_version_is_that_of_what_is_installed() -> None:
    assert sagnac.__version__ == importlib.metadata.version("sagnac")
