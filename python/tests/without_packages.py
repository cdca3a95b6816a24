"""What works in a Python with nothing but the wheel: run by `cargo xtask wheel` in an environment of its own."""

import json
import sys
from pathlib import Path

import sagnac

CHAMBER = Path(__file__).parents[2] / "testdata/chamber"


def main() -> None:
    others = [name for name in ("numpy", "pandas", "polars", "pyarrow", "matplotlib") if name in sys.modules]
    assert not others, f"imported: {others}"
    runs = [CHAMBER / "cycle-1.csv.gz", CHAMBER / "cycle-2.csv.gz"]
    unit = sagnac.calibrate(runs, CHAMBER / "bench.toml", model="bias 3, rate 0")
    proof = unit.verify(CHAMBER / "retest.csv.gz", CHAMBER / "limits.toml")
    assert proof.passed and json.loads(proof.to_json())["axes"], proof
    assert len(unit.image()) == 256 and unit.image()[:4] == b"SAGN"
    assert unit.residuals().to_pydict()["hours"][0] > 0.0
    assert "RLG-0001" in repr(unit) and "<table>" in unit._repr_html_()
    try:
        unit.plot()
    except sagnac.InputError as error:
        assert "matplotlib" in error.reason or "numpy" in error.reason, error
    except ImportError as error:
        raise AssertionError(f"a bare ImportError: {error}") from error
    else:
        raise AssertionError("plots without matplotlib")
    try:
        sagnac.calibrate({"time_s": [0.0], "counts": [1]}, arcsec_per_count=1.0)
    except sagnac.InputError as error:
        assert error.help == "pip install numpy", error
    else:
        raise AssertionError("columns without numpy")
    print("the package works without any other")


main()
