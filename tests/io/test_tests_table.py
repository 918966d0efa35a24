"""A table of tests in the ways that people write it; what is wrong is told with its line."""

from __future__ import annotations

import pytest

from damperfit.errors import ConfigurationError
from damperfit.io import is_tests_table, read_tests
from damperfit.io.tests_table import _misspelt

TWO = ("rebound", "compression")


def table(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "tests.csv"
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_separators_umlauts_and_other_columns(tmp_path, encoding, mark) -> None:
    rows = [
        "Datei|Rebound|compression|S/N|Kunde|Farbe",
        "a.csv|12|-8|0077|Müller|grün",
        "|||||",
        "",
    ]
    path = table(tmp_path, "\r\n".join(rows).replace("|", mark), encoding)
    found = read_tests(path, TWO)
    row = found.rows["a.csv"]
    assert dict(row.places) == {"rebound": 12, "compression": -8}
    assert row.identity.describe() == {"serial": "0077", "customer": "Müller", "Farbe": "grün"}
    assert row.line == 2
    assert found.notes == ()


def test_labels_words_and_empty_cells(tmp_path) -> None:
    text = "file,setting,compression\na.csv,R12 C8,\nsub/b.csv,,soft\n'c.csv,,\n"
    rows = read_tests(table(tmp_path, text), TWO).rows
    assert dict(rows["a.csv"].places) == {"rebound": 12, "compression": 8}
    assert dict(rows["sub/b.csv"].places) == {"compression": "soft"}


def test_the_same_row_twice_is_one(tmp_path) -> None:
    assert (
        len(read_tests(table(tmp_path, "file,setting\na.csv,1\na.csv,1\n"), ("setting",)).rows) == 1
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        (
            "flie,setting\na.csv,1\n",
            r":1: no column 'file'; found flie, setting; name the one",
        ),
        (
            "file,setting\na.csv,1\na.csv,2\n",
            r":3: 'a\.csv' is in line 2 too, with other values",
        ),
        ("file,serial\na.csv,1\n\na.csv,2\n", r":4: 'a\.csv' is in line 2 too"),
        ("file,setting\na.csv,1,2\n", r":2: 3 fields, but 2 names in line 1"),
        ("file,setting\n,1\n", r":2: no file name in column 'file'"),
        ("file,setting\na.csv,1e9\n", r":2: setting: found '1e9', expected clicks"),
        ("file,setting,setting\na.csv,1,2\n", r":1: two columns are named 'setting'"),
    ],
)
def test_a_bad_table_is_told_with_its_line(tmp_path, text, says) -> None:
    with pytest.raises(ConfigurationError, match=says):
        read_tests(table(tmp_path, text), ("setting",))


def test_a_label_that_names_one_of_two_adjusters_is_told(tmp_path) -> None:
    with pytest.raises(
        ConfigurationError, match=r":2: setting: found '12', expected a place for each"
    ):
        read_tests(table(tmp_path, "file,setting\na.csv,12\n"), TWO)


def test_a_misspelt_column_is_kept_and_said(tmp_path) -> None:
    found = read_tests(table(tmp_path, "file,rebond\na.csv,12\n"), TWO)
    assert dict(found.rows["a.csv"].places) == {}
    assert found.rows["a.csv"].identity.describe() == {"rebond": "12"}
    assert "column 'rebond' is kept as a remark" in found.notes[0]
    assert "'rebound'" in found.notes[0]


def test_a_missing_table_is_told(tmp_path) -> None:
    with pytest.raises(ConfigurationError, match="cannot be read"):
        read_tests(tmp_path / "none.csv", TWO)


def test_a_log_of_that_name_is_no_table(tmp_path) -> None:
    assert not is_tests_table(table(tmp_path, "time_s,displacement_mm,force_N\n0,1,2\n"))
    assert is_tests_table(table(tmp_path, "Setting;File\n1;a.csv\n"))
    assert not is_tests_table(tmp_path / "other.csv")


@pytest.mark.parametrize(("name", "is_said"), [("gas_presure", True), ("skw", False)])
def test_only_a_long_name_is_near_a_misspelt_column(tmp_path, name, is_said) -> None:
    assert bool(_misspelt([name], [], tmp_path / "tests.csv")) is is_said
