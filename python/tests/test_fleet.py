"""A fleet's table is read by anything: polars, DuckDB, pyarrow and pandas see the same rows."""

from __future__ import annotations

import shutil
from pathlib import Path

import duckdb
import pandas
import polars
import pyarrow.parquet
from conftest import CHAMBER, MODEL, Program


def test_the_table_of_a_fleet_is_read_by_anything(program: Program, tmp_path: Path) -> None:
    for unit, log in enumerate(("cycle-1", "cycle-2", "retest"), 1):
        folder = tmp_path / f"units/RLG-{unit}"
        folder.mkdir(parents=True)
        shutil.copy(CHAMBER / f"{log}.csv.gz", folder)
    (tmp_path / "bench.toml").write_text('arcsec_per_count = 0.15125\naxis = "z"\n')
    source = ["units", "--setup", "bench.toml", "--model", MODEL]
    program("fleet", "calibrate", *source, "-o", "fleet", cwd=tmp_path)
    path = str(tmp_path / "fleet/fleet.parquet")
    wanted = polars.read_parquet(path)
    assert wanted["unit"].to_list() == ["RLG-1", "RLG-2", "RLG-3"] and set(wanted["outcome"]) == {"calibrated"}
    assert [len(terms) for terms in wanted["terms"]] == [len(values) for values in wanted["coefficients"]]
    assert not wanted["with_prior"].any()
    by_duckdb = duckdb.sql(f"SELECT unit, residual_dph, coefficients FROM '{path}' ORDER BY unit")
    assert by_duckdb is not None
    rows = by_duckdb.fetchall()
    assert [row[1] for row in rows] == wanted["residual_dph"].to_list()
    assert [row[2] for row in rows] == wanted["coefficients"].to_list()
    table = pyarrow.parquet.read_table(path)
    assert table.column("residual_dph").to_pylist() == wanted["residual_dph"].to_list()
    assert table.schema.metadata[b"sagnac.fleet"] == b"1"
    assert pandas.read_parquet(path)["lag_s"].tolist() == wanted["lag_s"].to_list()
