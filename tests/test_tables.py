"""Tables: columns of the contract, units, nulls, files that are bit for bit the same, and back."""

import csv
import hashlib
import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.errors import ConfigurationError
from damperfit.identification import compare
from damperfit.problem import listed_names
from damperfit.simulation import simulate, sine_motion
from damperfit.tables.columns import (
    PAPER_QUANTITIES,
    column_kinds,
    describe_tables,
    quantity_records,
)
from damperfit.tables.files import (
    check_files,
    lay_out,
    read_rows,
    safe_cell,
    table_quantities,
    time_series_table,
    write_table,
)
from damperfit.tables.rows import characteristic_rows
from damperfit.tested.setting import Setting
from tests.fakes import campaign, fit, make_tables, trace, values_in
from tests.report_folder import put_responses

MOTION = ["time_s", "displacement_m", "velocity_m_per_s"]
PRESSURES = ["pressure_1_Pa", "pressure_2_Pa", "pressure_3_Pa"]
VALUES = Parameters(1.8e4, 3.5e6, 2.6e6, 3.6e8, 50.0)


def response():
    motion = sine_motion(0.032, 1.5, cycles=1, sample_rate=500)
    return simulate(VALUES, PURDY_DAMPER, motion)


def compared(done):
    return [compare(f.parameters, log.trace, PURDY_DAMPER) for f in done.fits for log in f.logs]


# Files


def test_parquet_carries_units_provenance_and_page_checksums(tmp_path: Path) -> None:
    path = tmp_path / "parameters.parquet"
    table = make_tables(campaign(fit(1), fit(2)), facts={"inputs": {"a": "00"}})["parameters"]
    write_table(path, table)
    schema = pq.read_schema(path)
    assert schema.field("k_e").metadata[b"unit"] == b"Pa"
    entry = json.loads(schema.metadata[b"damperfit"])
    assert (entry["schema_version"], entry["table"]) == (2, "parameters")
    assert entry["inputs"] == {"a": "00"}
    assert pq.read_table(path, page_checksum_verification=True).equals(table)
    write_table(path, time_series_table(response()))
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1
    path.write_bytes(data)
    with pytest.raises(OSError, match=r"(?i)crc|checksum"):
        pq.read_table(path, page_checksum_verification=True)


def test_csv_holds_the_same_numbers_to_the_last_digit_and_no_formula(tmp_path: Path) -> None:
    path = tmp_path / "parameters.csv"
    write_table(path, make_tables(campaign(fit(7, mse=0.1 + 0.2, f_0=-3.5)))["parameters"])
    with path.open(newline="") as file:
        row = next(csv.DictReader(file))
    assert list(row) == list(column_kinds("parameters"))
    assert float(row["mse_percent"]) == 0.1 + 0.2
    assert float(row["r_m2"]) == 2.0e6 * 1.1**7
    assert (row["r_m1_se"], row["f_0"]) == ("", "-3.5")
    evil = "=cmd|'/c calc'!A1.csv"
    write_table(path, make_tables(campaign(fit(1, logs=(evil, "-x.csv"))))["mse"])
    with path.open(newline="") as file:
        assert [row["log"] for row in csv.DictReader(file)] == ["", "'" + evil, "'-x.csv"]
    for text in ("=1", "+1", "-1", "@x", "\tx", "\rx"):
        assert safe_cell(text) == "'" + text


def test_responses_hold_the_window_of_each_log_in_a_row_group_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "responses.parquet"
    done = campaign(fit(1, logs=("a.csv", "b.csv")), fit(2))
    put_responses(path, done, compared(done))
    file = pq.ParquetFile(path)
    assert (file.metadata.num_rows, file.metadata.num_row_groups) == (3 * 333, 3)
    names = ["setting", "log", *MOTION, "force_measured_N", "force_N", *PRESSURES]
    assert file.schema_arrow.names == names
    table = file.read_row_group(1)
    trace = done.fits[0].logs[1].trace
    assert set(table["log"].to_pylist()) == {"b.csv"}
    np.testing.assert_array_equal(table["force_measured_N"], trace.force[trace.compared])
    np.testing.assert_allclose(table["time_s"][0].as_py(), 10.0 + 333 / 500.0)
    columns = [file.metadata.row_group(1).column(k) for k in range(len(names))]
    assert {one.path_in_schema for one in columns if one.is_stats_set} == {"setting", "log"}


# And back


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_parameters_come_back_exactly(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"parameters{suffix}"
    done = campaign(fit(1), fit(20, f_0=1.25))
    write_table(path, make_tables(done, expected=(7,))["parameters"])
    assert values_in(path) == {1: done.fits[0].parameters, 20: done.fits[1].parameters}


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("none.csv", None, "no such file"),
        ("x.csv", b"setting,r_m1\n1,2\n", "has no column 'r_m2'"),
        ("x.csv", b"r_m1,r_m2,r_m3,k_e,f_f\n1,2,3,4,5\n", "has no column 'setting'"),
        ("x.csv", b"setting,r_m1,r_m2,r_m3,k_e,f_f\n1,a,2,3,4,5\n", "could not convert"),
        ("x.csv", b"\xff\xfe\x00", "not a parameters table"),
        ("x.parquet", b"PAR1 not really", "not a parameters table"),
        # A row without numbers is a setting without parameters.
        ("x.csv", b"setting,r_m1,r_m2,r_m3,k_e,f_f\n1,2\n", {}),
        # A table of true values may lack the offset.
        (
            "truth.csv",
            b"# made\nsetting,r_m1,r_m2,r_m3,k_e,f_f\n4,1e4,2e6,3e6,4e8,50\n",
            {4: Parameters(1e4, 2e6, 3e6, 4e8, 50.0, 0.0)},
        ),
    ],
)
def test_a_table_that_is_none_is_refused_in_a_sentence(tmp_path, name, content, says) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    if isinstance(says, dict):
        assert values_in(path) == says
        return
    with pytest.raises(ConfigurationError, match=says):
        values_in(path)


def test_a_table_s_own_quantities_come_before_those_of_run_json(tmp_path) -> None:
    own, beside = PAPER_QUANTITIES[:2], PAPER_QUANTITIES[2:4]
    path = tmp_path / "parameters.parquet"

    def put(facts) -> None:
        table = pa.table({"setting": [1]})
        entry = {b"damperfit": json.dumps(facts).encode()}
        pq.write_table(table.replace_schema_metadata(entry), path)

    put({})
    assert table_quantities(path) == PAPER_QUANTITIES
    record = {"quantities": quantity_records(beside)}
    (tmp_path / "run.json").write_text(json.dumps(record), encoding="utf-8")
    assert [one.name for one in table_quantities(path)] == [one.name for one in beside]
    put({"quantities": quantity_records(own)})
    assert [one.name for one in table_quantities(path)] == [one.name for one in own]
    # Of a folder with CSV files alone the columns tell, so that none passes for an adjuster.
    path.unlink()
    columns = "setting,bleed,slope,bleed_status,slope_status"
    path.with_suffix(".csv").write_text(f"{columns}\nL6 H1,1.5e-9,2,fitted,fitted\n")
    known = table_quantities(path, {})
    assert [one.name for one in known] == ["bleed", "slope"]
    (row,) = read_rows(tmp_path, "parameters", [], known)
    assert (row["setting"].label, row["bleed"]) == ("L6 H1", 1.5e-9)


@pytest.mark.parametrize("n_missing", [0, 6, 7])
def test_columns_that_the_run_wrote_and_a_file_lacks_are_named(tmp_path, n_missing) -> None:
    names = list(column_kinds("parameters"))
    kept = names[: len(names) - n_missing]
    row = ",".join("1" if name == "setting" else "" for name in kept)
    (tmp_path / "parameters.csv").write_text(f"{','.join(kept)}\n{row}\n", encoding="utf-8")
    remarks: list = []
    record = {"schema": describe_tables()}
    (found,) = read_rows(tmp_path, "parameters", remarks, record=record)
    lost, *others = map(str, remarks)
    assert lost == "parameters.parquet is missing"
    assert found["setting"] == 1
    assert list(found) == names
    missing = names[len(names) - n_missing :]
    told = [f"parameters.csv has no column {listed_names(missing)}"]
    assert others == (told if missing else [])
    # A run of another version lacks nothing that it did not write.
    older = {"schema": {"parameters": [{"name": name} for name in kept]}}
    read_rows(tmp_path, "parameters", remarks := [], record=older)
    assert list(map(str, remarks)) == [lost]


def test_every_file_of_another_run_is_named_and_what_is_no_table_is_passed_over(tmp_path) -> None:
    for name in ("a.parquet", "b.parquet", "c.parquet", "d.txt"):
        (tmp_path / name).write_bytes(name.encode())
    right = hashlib.sha256(b"b.parquet").hexdigest()
    files = {
        "report.md": "0", "d.txt": "0", "../a.parquet": "0", "missing.parquet": "0", "a.parquet": 3,
        "b.parquet": right, "c.parquet": "0",
    }  # fmt: skip
    remarks: list = []
    check_files(tmp_path, {"files": files}, remarks, ("a", "b", "c", "d", "missing"))
    assert [str(remark).partition(" ")[0] for remark in remarks] == ["a.parquet", "c.parquet"]


# The table of characteristics: known loops, with and without gas, by segment and speed.

SPEED = 0.032 * 2 * math.pi * 1.5  # peak of the synthetic log, m/s
GAS = -130.0


def rows_of(log, force=None, *, gas=GAS):
    """Rows of a log whose model says ``force``, by point and speed."""
    damper = SimpleNamespace(
        rest_force=lambda x: None if gas is None else np.full_like(x, gas, dtype=np.float64)
    )
    seen = SimpleNamespace(force=log.force if force is None else force)
    return list(characteristic_rows(7, log, seen, damper))


def test_hysteresis_is_opening_less_closing_force_in_both_strokes() -> None:
    log = trace(7)
    acceleration = np.gradient(log.velocity, log.interval)
    peak, *named = rows_of(replace(log, force=2500.0 * log.velocity + 10.0 * acceleration))
    omega = 2 * math.pi * 1.5
    there = 10.0 * omega * math.sqrt(SPEED**2 - peak["hysteresis_speed_m_per_s"] ** 2)
    # Opening: speed rises; in bump the acceleration is then downwards.
    assert peak["measured_hysteresis_rebound_N"] == pytest.approx(2.0 * there, rel=1e-3)
    assert peak["measured_hysteresis_bump_N"] == pytest.approx(-2.0 * there, rel=1e-3)
    for row in named[:4]:
        there = 10.0 * omega * math.sqrt(SPEED**2 - row["speed_rebound_m_per_s"] ** 2)
        assert row["measured_hysteresis_rebound_N"] == pytest.approx(2.0 * there, rel=1e-2)
        assert row["measured_hysteresis_bump_N"] == pytest.approx(-2.0 * there, rel=1e-2)


def test_which_of_several_adjusters_was_turned_is_read_back(tmp_path) -> None:
    """A row for each: the page and report.md show both changes, as the terminal does."""
    setting = Setting((("low_speed", 6), ("high_speed", 3)))
    rows = [
        {"setting": setting, "speed_m_per_s": 0.1, "stroke": "rebound", "changed": name}
        for name in setting.adjusters
    ]
    write_table(tmp_path / "adjustment.parquet", lay_out("adjustment", rows, settings=[setting]))
    known = read_rows(tmp_path, "adjustment", [])
    assert [row["setting"] for row in known] == [setting, setting]
    assert [row["changed"] for row in known] == ["low_speed", "high_speed"]
