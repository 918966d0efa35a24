"""Tables: columns, units, nulls, files that are bit for bit the same, cells that are safe."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from damperfit.adjustment.clicks import Adjustment, Click
from damperfit.adjustment.force_at import Force
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
from damperfit.errors import ConfigurationError
from damperfit.identification import Outcome, compare
from damperfit.simulation import simulate, sine_motion
from damperfit.tables import (
    MISSING,
    PAPER_QUANTITIES,
    WITHHELD,
    describe_tables,
    grade,
    make_tables,
    safe_cell,
    time_series_table,
    write_responses,
    write_table,
)
from damperfit.tables.columns import _setting_columns, quantity_records, read_setting
from damperfit.tables.files import read_facts, table_quantities
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Assessment, Objection
from tests.fakes import campaign, fit, values_in

PDQ = PURDY_DAMPER.quantities

CONTRACT_PARAMETERS = [
    "setting",
    *("r_m1", "r_m2", "r_m3", "k_e", "f_f", "f_0"),
    *(
        f"{name}_{part}"
        for name in ("r_m1", "r_m2", "r_m3", "k_e", "f_f", "f_0")
        for part in ("se", "ci_low", "ci_high", "status")
    ),
    *(f"{name}_misfit_se" for name in ("r_m1", "r_m2", "r_m3", "k_e", "f_f", "f_0")),
    *("mse_percent", "grade", "outcome", "n_logs", "n_samples", "n_cycles", "evaluations"),
    *("cavitation_fraction", "r_m3_cavitation_margin"),
    *("lowest_pressure", "lowest_pressure_chamber"),
    *("lowest_pressure_displacement", "lowest_pressure_velocity", "safe_gas_pressure"),
    "grade_reason",
]
CONTRACT_MSE = ["setting", "log", "mse_percent", "noise_floor_percent", "grade", "n_samples"]
CONTRACT_SERIES = [
    *("time_s", "displacement_m", "velocity_m_per_s", "force_N"),
    *("pressure_1_Pa", "pressure_2_Pa", "pressure_3_Pa"),
]


def _compared(done):
    return [compare(f.parameters, log.trace, PURDY_DAMPER) for f in done.fits for log in f.logs]


def test_columns_and_their_order_are_those_of_the_contract() -> None:
    tables = make_tables(campaign(fit(1)))
    assert tables.parameters.column_names == CONTRACT_PARAMETERS
    assert tables.mse.column_names == [*CONTRACT_MSE, "role"]


def test_every_number_column_says_its_unit_and_every_column_its_meaning() -> None:
    tables = make_tables(campaign(fit(1)))
    for field in (*tables.parameters.schema, *tables.mse.schema, *tables.adjustment.schema):
        assert field.metadata[b"description"], field.name
        assert field.metadata[b"unit"] or str(field.type) == "string", field.name
    units = {f.name: f.metadata[b"unit"].decode() for f in tables.parameters.schema}
    assert units["k_e"] == units["k_e_ci_low"] == "Pa"
    assert units["r_m1"] == "s sqrt(N)/(m kg)"
    # A pressure drop over a mass flow: N/m2 over kg/s.
    assert units["r_m2"] == units["r_m3"] == units["r_m3_se"] == "N s/(m2 kg)"
    assert units["f_f"] == units["f_0"] == units["f_0_ci_low"] == "N"
    assert units["lowest_pressure"] == units["safe_gas_pressure"] == "Pa"
    assert units["lowest_pressure_displacement"] == "m"
    assert units["lowest_pressure_velocity"] == "m/s"


def test_where_the_lowest_pressure_is_stands_in_its_own_columns() -> None:
    row = make_tables(campaign(fit(1))).parameters.to_pylist()[0]
    assert row["lowest_pressure"] == 7e4
    assert row["lowest_pressure_chamber"] == 2
    assert row["lowest_pressure_displacement"] == 0.001
    assert row["lowest_pressure_velocity"] == 0.3
    assert row["r_m3_cavitation_margin"] == 0.176
    assert row["safe_gas_pressure"] == 3.9e5


def test_the_schema_of_run_json_is_the_schema_of_the_files() -> None:
    tables = make_tables(campaign(fit(1)))
    described = describe_tables()
    assert set(described) == {
        *("parameters", "mse", "adjustment", "characteristics", "responses", "profiles"),
        "valves",
    }
    assert [c["name"] for c in described["parameters"]] == tables.parameters.column_names
    assert [c["type"] for c in described["mse"]] == [str(f.type) for f in tables.mse.schema]


def test_values_are_those_of_the_fits_and_intervals_stay_empty() -> None:
    row = make_tables(campaign(fit(3, f_0=-2.5))).parameters.to_pylist()[0]
    assert row["setting"] == 3
    assert row["r_m1"] == 1.4e4 + 2100.0
    assert row["f_0"] == -2.5
    assert (row["r_m1_status"], row["r_m3_status"], row["f_0_status"]) == (
        "fitted",
        "shared",
        "fixed",
    )
    assert row["grade"] == "excellent"
    assert row["outcome"] == "converged"
    assert (row["n_logs"], row["n_samples"], row["evaluations"]) == (1, 333, 12)
    for name in PURDY_DAMPER.names:
        assert row[f"{name}_se"] is row[f"{name}_ci_low"] is row[f"{name}_ci_high"] is None


def test_a_number_that_is_none_is_null_not_nan() -> None:
    row = make_tables(campaign(fit(1, outcome=Outcome.CAVITATING))).parameters.to_pylist()[0]
    assert row["r_m3_cavitation_margin"] is None


def test_a_setting_has_one_row_of_mse_and_each_of_its_logs_another() -> None:
    rows = make_tables(campaign(fit(4, logs=("a.csv", "b.csv")), fit(5))).mse.to_pylist()
    assert [(row["setting"], row["log"], row["n_samples"]) for row in rows] == [
        (4, "", 666),
        (4, "a.csv", 333),
        (4, "b.csv", 333),
        (5, "", 333),
        (5, "setting_05.csv", 333),
    ]


def test_a_setting_that_was_expected_is_an_explicit_gap() -> None:
    table = make_tables(campaign(fit(1), fit(3)), expected=(1, 2, 3)).parameters
    assert table["setting"].to_pylist() == [1, 2, 3]
    assert table["outcome"].to_pylist()[1] == MISSING
    assert table["r_m1"].to_pylist()[1] is None


@pytest.mark.parametrize(
    ("mse", "word"),
    [(0.0, "excellent"), (0.999, "excellent"), (1.0, "good"), (5.0, "poor"), (math.nan, "poor")],
)
def test_grades_are_the_papers(mse: float, word: str) -> None:
    assert grade(mse) == word


def test_a_grade_that_is_withheld_says_why_in_every_table() -> None:
    why = (Objection("bound", "r_m1", "R_m1 ran out"), Objection("misfit", "", "much repeats"))
    held_back = Assessment(objections={fit(2).setting: why})
    tables = make_tables(campaign(fit(1), fit(2)), assessment=held_back)
    rows = tables.parameters.to_pylist()
    assert [row["grade"] for row in rows] == ["excellent", WITHHELD]
    assert [row["grade_reason"] for row in rows] == [None, "R_m1 ran out; much repeats"]
    assert [(row["setting"], row["grade"]) for row in tables.mse.to_pylist()] == [
        *((1, "excellent"), (1, "excellent")),
        *((2, WITHHELD), (2, WITHHELD)),
    ]


def test_frames_are_pandas_with_the_same_rows() -> None:
    frame = make_tables(campaign(fit(1), fit(2))).frame("parameters")
    assert list(frame.columns) == CONTRACT_PARAMETERS
    assert frame["setting"].tolist() == [1, 2]


def test_parquet_carries_units_provenance_and_page_checksums(tmp_path: Path) -> None:
    path = tmp_path / "parameters.parquet"
    tables = make_tables(campaign(fit(1), fit(2)), provenance={"inputs": {"a": "00"}})
    write_table(path, tables.parameters)
    schema = pq.read_schema(path)
    assert schema.field("k_e").metadata[b"unit"] == b"Pa"
    entry = json.loads(schema.metadata[b"damperfit"])
    assert entry["schema_version"] == 2
    assert entry["table"] == "parameters"
    assert entry["inputs"] == {"a": "00"}
    assert pq.read_table(path, page_checksum_verification=True).equals(tables.parameters)


def test_a_flipped_bit_is_found_when_the_checksums_are_read(tmp_path: Path) -> None:
    path = tmp_path / "x.parquet"
    motion = sine_motion(0.032, 1.5, cycles=1, sample_rate=500)
    response = simulate(Parameters(1.8e4, 3.5e6, 2.6e6, 3.6e8, 50.0), PURDY_DAMPER, motion)
    write_table(path, time_series_table(response))
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1
    path.write_bytes(data)
    with pytest.raises(OSError, match=r"(?i)crc|checksum"):
        pq.read_table(path, page_checksum_verification=True)


def test_csv_holds_the_same_numbers_to_the_last_digit(tmp_path: Path) -> None:
    path = tmp_path / "parameters.csv"
    tables = make_tables(campaign(fit(7, mse=0.1 + 0.2)))
    write_table(path, tables.parameters)
    with path.open(newline="") as file:
        row = next(csv.DictReader(file))
    assert list(row) == CONTRACT_PARAMETERS
    assert float(row["mse_percent"]) == 0.1 + 0.2
    assert float(row["r_m2"]) == 2.0e6 * 1.1**7
    assert row["r_m1_se"] == ""


def test_no_spreadsheet_takes_a_log_name_for_a_formula(tmp_path: Path) -> None:
    path = tmp_path / "mse.csv"
    evil = "=cmd|'/c calc'!A1.csv"
    write_table(path, make_tables(campaign(fit(1, logs=(evil, "-x.csv")))).mse)
    with path.open(newline="") as file:
        assert [row["log"] for row in csv.DictReader(file)] == ["", "'" + evil, "'-x.csv"]


@pytest.mark.parametrize("text", ["=1", "+1", "-1", "@x", "\tx", "\rx"])
def test_cells_that_start_like_a_formula_get_an_apostrophe(text: str) -> None:
    assert safe_cell(text) == "'" + text


def test_a_negative_number_is_never_touched(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    write_table(path, make_tables(campaign(fit(1, f_0=-3.5))).parameters)
    assert ",-3.5," in path.read_text()


def test_an_unknown_kind_of_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"\.csv or \.parquet"):
        write_table(tmp_path / "x.xlsx", make_tables(campaign(fit(1))).mse)


def test_responses_hold_the_window_of_each_log_in_a_row_group_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "responses.parquet"
    done = campaign(fit(1, logs=("a.csv", "b.csv")), fit(2))
    n_rows = write_responses(path, done, _compared(done))
    file = pq.ParquetFile(path)
    assert (n_rows, file.metadata.num_row_groups) == (3 * 333, 3)
    assert file.schema_arrow.names == [
        "setting",
        "log",
        *CONTRACT_SERIES[:3],
        "force_measured_N",
        *CONTRACT_SERIES[3:],
    ]
    table = file.read_row_group(1)
    trace = done.fits[0].logs[1].trace
    assert set(table["log"].to_pylist()) == {"b.csv"}
    np.testing.assert_array_equal(table["force_measured_N"], trace.force[trace.compared])
    np.testing.assert_allclose(table["time_s"][0].as_py(), 10.0 + 333 / 500.0)
    assert min(table["pressure_1_Pa"].to_pylist()) > 0.0
    columns = [file.metadata.row_group(1).column(k) for k in range(len(table.column_names))]
    found = {one.path_in_schema for one in columns if one.is_stats_set}
    assert found == {"setting", "log"}


def test_equal_results_give_equal_bytes(tmp_path: Path) -> None:
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        done = campaign(fit(1), fit(2))
        write_responses(tmp_path / folder / "r", done, _compared(done))
        write_table(tmp_path / folder / "p", make_tables(done).parameters, suffix=".parquet")
        write_table(tmp_path / folder / "c", make_tables(done).parameters, suffix=".csv")
    for name in ("r", "p", "c"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_a_time_series_has_the_columns_of_the_contract() -> None:
    motion = sine_motion(0.032, 1.5, cycles=1, sample_rate=500)
    response = simulate(Parameters(1.8e4, 3.5e6, 2.6e6, 3.6e8, 50.0), PURDY_DAMPER, motion)
    table = time_series_table(response)
    assert table.column_names == CONTRACT_SERIES
    np.testing.assert_array_equal(table["force_N"], response.force)


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_parameters_come_back_exactly(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"parameters{suffix}"
    done = campaign(fit(1), fit(20, f_0=1.25))
    write_table(path, make_tables(done, expected=(7,)).parameters)
    back = values_in(path)
    assert back == {1: done.fits[0].parameters, 20: done.fits[1].parameters}


def test_a_truth_table_without_an_offset_is_read(tmp_path: Path) -> None:
    path = tmp_path / "truth.csv"
    path.write_text("setting,r_m1,r_m2,r_m3,k_e,f_f\n4,1e4,2e6,3e6,4e8,50\n")
    assert values_in(path) == {4: Parameters(1e4, 2e6, 3e6, 4e8, 50.0, 0.0)}


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("none.csv", None, "No such file"),
        ("x.csv", b"setting,r_m1\n1,2\n", "has no column 'r_m2'"),
        ("x.csv", b"setting,r_m1,r_m2,r_m3,k_e,f_f\n1,a,2,3,4,5\n", "could not convert"),
        ("x.csv", b"\xff\xfe\x00", "not a parameters table"),
        ("x.parquet", b"PAR1 not really", "not a parameters table"),
        ("x.csv", b"setting,r_m1,r_m2,r_m3,k_e,f_f\n1,2\n", "{}"),
    ],
)
def test_a_table_that_is_none_is_refused_in_a_sentence(
    tmp_path: Path, name: str, content: bytes | None, says: str
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    if says == "{}":  # a row without numbers is a setting without parameters
        assert values_in(path) == {}
        return
    with pytest.raises(ConfigurationError, match=says):
        values_in(path)


def test_a_change_of_force_stands_in_the_row_of_the_harder_setting_number_by_number() -> None:
    first, second = (
        Force(setting, 0.3, "bump", -100.0 * setting, 2.0, 2.0, np.zeros(0), gas=-20.0, tare=3.0)
        for setting in (1, 2)
    )
    click = Click(1, 2, 0.3, "bump", -100.0, -105.5, -94.5, 90.0, 84.0, 96.0)
    told = Adjustment(forces=(first, second), clicks=(click,))
    plain, changed = make_tables(campaign(fit(1), fit(2)), adjustment=told).adjustment.to_pylist()
    beside = {
        "force_misfit_se_N": 0.0, "measured_N": None, "measured_se_N": None,
        "difference_N": None, "origin": "model", "model_N": None, "gas_N": -20.0,
        "friction_N": None, "tare_N": 3.0, "tested": "yes", "measured_as": None,
        "measured_opening_N": None, "measured_closing_N": None, "measured_peak_N": None,
    }  # fmt: skip
    assert plain == beside | {
        "setting": 1, "speed_m_per_s": 0.3, "stroke": "bump", "force_N": -100.0, "force_se_N": 2.0,
        "force_ci_low_N": first.low, "force_ci_high_N": first.high, "change_N": None,
        "change_ci_low_N": None, "change_ci_high_N": None, "change_percent": None,
        "change_percent_ci_low": None, "change_percent_ci_high": None,
    }  # fmt: skip
    assert first.high - first.low == pytest.approx(7.84, abs=1e-3)
    assert changed["setting"] == 2
    assert [changed[name] for name in list(changed)[7:13]] == [
        -100.0,
        -105.5,
        -94.5,
        90.0,
        84.0,
        96.0,
    ]


@pytest.mark.parametrize(
    ("table", "adjusters", "columns"),
    [
        ("adjustment", ("rebound",), ["setting", "rebound"]),
        ("adjustment", ("rebound", "bump"), ["setting", "rebound", "bump", "changed"]),
        ("mse", ("rebound", "bump"), ["setting", "rebound", "bump"]),
    ],
)
def test_the_adjuster_that_changes_is_named_where_there_are_several(
    table, adjusters, columns
) -> None:
    settings = [Setting(tuple((name, place) for name in adjusters)) for place in (1, 2)]
    assert [one.name for one in _setting_columns(table, settings)] == columns


def test_a_click_of_forty_letters_is_read_as_one() -> None:
    for n, expected in ((40, ValueError), (41, None)):
        text = "7" * n
        if expected is None:  # a sentence, taken as it stands
            assert read_setting({"setting": text}) == Setting.of(text)
        else:
            with pytest.raises(expected, match="expected clicks"):
                read_setting({"setting": text})


def test_an_empty_cell_says_no_setting() -> None:
    assert read_setting({"setting": None}) is read_setting({"setting": ""}) is None
    assert read_setting({"setting": 0}) == Setting.of(0)


def test_a_table_s_own_quantities_come_before_those_of_run_json(tmp_path) -> None:
    own, beside = PDQ[:2], PDQ[2:4]
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


def test_responses_of_a_campaign_without_quantities_are_of_the_paper_s(tmp_path) -> None:
    path = tmp_path / "responses.parquet"
    done = campaign()
    assert not done.quantities
    write_responses(path, done, [])
    names = [one["name"] for one in read_facts(path)["quantities"]]
    assert names == [one.name for one in PAPER_QUANTITIES]
