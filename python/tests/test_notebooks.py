"""The notebooks run, and their pages in docs/ hold the cells that they have now."""

from __future__ import annotations

import sys
from pathlib import Path

import jupytext
import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "python/notebooks"))
import pages  # noqa: E402


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", pages.NAMES)
def test_a_notebook_runs_and_is_shown(name: str) -> None:
    notebook = pages.executed(name)
    pictures = [
        output for cell in notebook.cells for output in cell.get("outputs", []) if "image/png" in output.get("data", {})
    ]
    assert pictures, "a notebook without a figure"
    page = (ROOT / f"docs/notebooks/{name}.md").read_text(encoding="utf-8")
    for cell in jupytext.read(Path(pages.HERE) / f"{name}.py").cells:
        for line in cell.source.splitlines():
            assert line.rstrip() in page, f"run `cargo xtask wheel --notebooks`: {line}"
    assert len(list((ROOT / f"docs/notebooks/{name}").glob("*.png"))) == len(pictures)
