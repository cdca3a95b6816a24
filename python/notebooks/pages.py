"""Runs the notebooks and makes their pages in docs/notebooks, with pictures: `cargo xtask wheel --notebooks`."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path
from typing import Any
from unittest import mock

import jupytext
from nbclient import NotebookClient
from nbconvert import MarkdownExporter
from traitlets.config import Config

HERE = Path(__file__).parent
PAGES = HERE.parents[1] / "docs/notebooks"
NAMES = ["accept_a_unit", "noise_beside_allantools", "a_year_of_one_unit"]


def executed(name: str) -> Any:
    """The notebook with its outputs; an error in a cell is raised."""
    notebook = jupytext.read(HERE / f"{name}.py")
    client = NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(HERE)}})
    # Figures go into the notebook, whatever the caller's backend is.
    with mock.patch.dict(os.environ, {"MPLBACKEND": "module://matplotlib_inline.backend_inline"}):
        client.execute()
    return notebook


def page(name: str) -> None:
    config = Config()
    # Tables of pandas as text: a page is read on paper too.
    config.NbConvertBase.display_data_priority = ["image/png", "text/plain"]
    text, resources = MarkdownExporter(config=config).from_notebook_node(executed(name))
    folder = PAGES / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for number, (output, bytes_) in enumerate(sorted(resources["outputs"].items()), 1):
        (folder / f"{number}.png").write_bytes(bytes_)
        text = text.replace(f"![png]({output})", f"![Figure {number}]({name}/{number}.png)")
    source = f"Made of `python/notebooks/{name}.py` by `cargo xtask wheel --notebooks`; do not edit."
    head, _, rest = text.partition("\n")
    lines = [line.rstrip() for line in f"{head}\n\n{source}\n{rest}".splitlines()]
    whole = re.sub(r"\n{3,}", "\n\n", "\n".join(lines)).rstrip() + "\n"
    (PAGES / f"{name}.md").write_text(whole, encoding="utf-8")


if __name__ == "__main__":
    for each in NAMES:
        page(each)
