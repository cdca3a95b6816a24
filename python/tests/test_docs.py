"""The examples of the pages and of the docstrings."""

from __future__ import annotations

import doctest

import pytest
from conftest import ROOT

import sagnac


@pytest.mark.usefixtures("in_chamber")
def test_examples_of_the_page() -> None:
    page = str(ROOT / "docs/how-to/python.md")
    done = doctest.testfile(page, module_relative=False, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert done.attempted > 20 and done.failed == 0


@pytest.mark.usefixtures("in_chamber")
def test_examples_of_docstrings() -> None:
    done = doctest.testmod(sagnac, optionflags=doctest.ELLIPSIS)
    assert done.attempted > 2 and done.failed == 0
