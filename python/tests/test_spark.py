"""The script of docs/how-to/fleet.md on Spark, with executors of their own: the records are those of the program."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import polars
from conftest import CHAMBER, MODEL, ROOT, Program


def test_spark_gives_the_records_of_the_program(program: Program, tmp_path: Path) -> None:
    for unit, log in enumerate(("cycle-1", "cycle-2", "retest"), 1):
        folder = tmp_path / f"units/RLG-{unit}"
        folder.mkdir(parents=True)
        shutil.copy(CHAMBER / f"{log}.csv.gz", folder)
    # A broken log is a row and not the end.
    (tmp_path / "units/RLG-4").mkdir()
    (tmp_path / "units/RLG-4/run.csv").write_text("time_s,counts,temperature_c\n1,2\n")
    (tmp_path / "bench.toml").write_text('arcsec_per_count = 0.15125\naxis = "z"\n')
    page = (ROOT / "docs/how-to/fleet.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"## On Spark\n.*?```python\n(.*?)```", page, re.DOTALL)
    (tmp_path / "fleet_spark.py").write_text(script)
    env = os.environ | {"PYSPARK_PYTHON": sys.executable, "SPARK_LOCAL_IP": "127.0.0.1", "SPARK_WORKER_DIR": str(tmp_path / "work")}
    done = subprocess.run([sys.executable, "fleet_spark.py"], cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    fleet = polars.read_parquet(tmp_path / "fleet.parquet/*.parquet").sort("unit")
    assert fleet["unit"].to_list() == ["RLG-1", "RLG-2", "RLG-3", "RLG-4"]
    shutil.rmtree(tmp_path / "units/RLG-4")
    program("fleet", "calibrate", "units", "--setup", "bench.toml", "--model", MODEL, "-o", "fleet", cwd=tmp_path)
    for unit, record in zip(fleet["unit"][:3], fleet["record"]):
        assert record.encode() == (tmp_path / f"fleet/records/{unit}.cal.json").read_bytes(), unit
    assert fleet["record"][3] is None and "run.csv" in fleet["refusal"][3]
