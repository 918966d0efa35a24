"""Workbook and CSV: every table, its units, what a spreadsheet makes of them."""

from __future__ import annotations

import csv
import io
from dataclasses import replace

import numpy as np
import openpyxl
import pytest

from damperfit.exporting import TARGETS, ExportOptions
from damperfit.exporting.tables import force_tables
from damperfit.units.shown_units import parse_units
from tests.exporting.conftest import told

POUND = 4.4482216152605


def workbook(handed, **options):
    content = TARGETS["xlsx"].export(handed, ExportOptions(**options)).files["damper.xlsx"]
    return openpyxl.load_workbook(io.BytesIO(content))  # a warning of its would be an error here


def rows_of(files, name, mark=","):
    return list(csv.reader(io.StringIO(files[name].decode()), delimiter=mark))


def test_one_sheet_a_table_with_units_and_a_frozen_heading(handed) -> None:
    book = workbook(handed)
    assert book.sheetnames == ["about", "forces", "parameters"]
    forces = book["forces"]
    assert forces.freeze_panes == "A3"
    assert [cell.value for cell in forces[1]] == [
        *("speed_m_per_s", "setting 1", "setting 10", "setting 20")
    ]
    assert [cell.value for cell in forces[2]] == ["m/s", "N", "N", "N"]
    table = force_tables(handed, common=True)[1]
    assert [row[2] for row in forces.iter_rows(min_row=3, values_only=True)] == pytest.approx(
        table.forces.tolist()
    )
    heads = [cell.value for cell in book["parameters"][1]]
    units = [cell.value for cell in book["parameters"][2]]
    assert units[heads.index("k_e")] == "Pa"
    assert forces["A1"].font.b
    assert "rebound" in " ".join(str(row[0].value) for row in book["about"].rows)


def test_units_are_converted_in_cells_headings_and_units(handed) -> None:
    plain, pounds = workbook(handed), workbook(handed, units=parse_units("lbf,in/s"))
    assert [cell.value for cell in pounds["forces"][2]] == ["in/s", "lbf", "lbf", "lbf"]
    assert pounds["forces"]["A1"].value == "speed_in_per_s"
    for k in (3, 40):
        assert pounds["forces"][f"C{k}"].value * POUND == pytest.approx(
            plain["forces"][f"C{k}"].value
        )
    heads = [cell.value for cell in pounds["parameters"][1]]
    place = heads.index("f_f")
    assert pounds["parameters"][2][place].value == "lbf"
    assert pounds["parameters"][3][place].value * POUND == pytest.approx(
        plain["parameters"][3][place].value
    )


def test_text_cannot_become_a_formula_and_bytes_are_the_same_each_time(handed) -> None:
    evil = told(handed, test={"damper": "=1+1\x07<&"})
    cells = [str(row[0].value) for row in workbook(evil)["about"].rows]
    assert "identity: damper =1+1 <&" in cells
    assert all(
        cell.data_type != "f" for sheet in workbook(evil) for row in sheet.rows for cell in row
    )
    first, second = (TARGETS["xlsx"].export(handed, ExportOptions()).files for _ in range(2))
    assert first == second


def test_each_force_has_its_interval_in_a_column_of_its_own(handed) -> None:
    settings = tuple(
        replace(one, own=("f_f",), shared=(), covariance=np.array([[1e-4]]))
        for one in handed.settings
    )
    forces = workbook(replace(handed, settings=settings))["forces"]
    heads = [cell.value for cell in forces[1]]
    assert heads[4:] == [f"± 95 % of setting {n}" for n in (1, 10, 20)]
    assert forces["E3"].value == pytest.approx(1.959964 * 0.01 * 50.0, rel=1e-4)
    assert len(heads) < 27


def test_a_decimal_comma_comes_with_semicolons(handed) -> None:
    options = ExportOptions(decimal=",", units=parse_units("daN"))
    files = TARGETS["csv"].export(handed, options).files
    head, first, *_ = rows_of(files, "damper.csv", ";")
    assert head == [
        "setting",
        "speed_m_per_s",
        "force_daN",
        "range",
        "force_ci_low_daN",
        "force_ci_high_daN",
    ]
    table = force_tables(handed, common=True)[0]
    assert float(first[2].replace(",", ".")) == pytest.approx(table.forces[0] / 10, abs=1e-3)
    assert b"." not in files["damper.csv"]
    head, first, *_ = rows_of(files, "damper_parameters.csv", ";")
    assert "f_f [daN]" in head
    assert float(first[head.index("f_f [daN]")].replace(",", ".")) == pytest.approx(5.0)


def test_csv_of_the_tables_is_the_tables(handed) -> None:
    files = TARGETS["csv"].export(handed, ExportOptions()).files
    assert set(files) == {"damper.csv", "damper_about.txt", "damper_parameters.csv"}
    about = files["damper_about.txt"].decode()
    for part in ("tested: ", "gas: ", "sign: forces", "MSE"):
        assert part in about
    head, first, *_ = rows_of(files, "damper_parameters.csv")
    assert "k_e [Pa]" in head
    assert float(first[head.index("k_e [Pa]")]) == handed.settings[0].values.k_e


def test_csv_says_of_each_row_whether_its_speed_was_tested(handed) -> None:
    tested = force_tables(handed)[0].tested
    for options, expected in (
        (ExportOptions(), {"tested"}),
        (ExportOptions(extend=2.0 * tested), {"tested", "untested"}),
        (
            ExportOptions(extend=2.0 * tested, units=parse_units("lbf,in/s")),
            {"tested", "untested"},
        ),
    ):
        files = TARGETS["csv"].export(handed, options).files
        head, *rows = rows_of(files, "damper.csv")
        assert head[3] == "range"
        assert {row[3] for row in rows} == expected
        edge = tested * (1.0 if options.units.is_si else 1.0 / 0.0254)
        for row in rows:
            assert (row[3] == "tested") == (abs(float(row[1])) <= 1.0001 * edge)
        about = files["damper_about.txt"].decode()
        assert ("UNTESTED" in about) == (len(expected) > 1)
