"""Rows of plain numbers that the core reads: the same doubles as pyarrow's, and nothing else."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from damperfit.compiled_core import compiled_core
from damperfit.readers import read_log
from damperfit.readers.dialect import Dialect
from damperfit.readers.options import ReadOptions
from damperfit.readers.rows import TextRows, _parsed, _plain, load_rows

RANDOM = np.random.default_rng(15)
SAMPLE = Path(__file__).parents[2] / "sample_runs" / "setting_01.csv"


def rows_of(text: str, n: int = 2, *, separator=",", decimal=".", start=0, more=0, clocks=()):
    dialect = Dialect(separator, decimal, ("",) * n, (), 1, 2, 0, ())
    clocks = frozenset(clocks)
    return TextRows("log", text.encode(), start, dialect, n, n + more, clocks, ReadOptions())


def same(found, expected) -> None:
    assert found is not None
    assert found.keys() == expected.keys()
    for i, values in expected.items():
        assert np.array_equal(found[i].view(np.int64), np.ascontiguousarray(values).view(np.int64))


@pytest.mark.parametrize("form", ["{:.3f}", "{:.9g}", "{:.15g}", "{:.6e}", "{:.4E}", "{:.0f}"])
@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_numbers_are_the_nearest_doubles(form: str, decimal: str, end: str) -> None:
    sizes = 10.0 ** RANDOM.uniform(-6.0, 6.0, (300, 2))
    lines = [
        ";".join(form.format(value) for value in row)
        for row in (sizes * RANDOM.choice([-1.0, 1.0], (300, 2))).tolist()
    ]
    text = rows_of(end.join(lines).replace(".", decimal) + end, separator=";", decimal=decimal)
    same(_plain(text, [0, 1]), _parsed(text, [0, 1]))


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("1,2\n-0,0\n007,1e5\n", {0: [1.0, -0.0, 7.0], 1: [2.0, 0.0, 1e5]}),
        (" 1 ,2  \n", {0: [1.0], 1: [2.0]}),
        ("1,\n,2\n", {0: [1.0, np.nan], 1: [np.nan, 2.0]}),
        ("\n1,2\n\n\r\n3,4\n", {0: [1.0, 3.0], 1: [2.0, 4.0]}),
        ("1,2\r\n3,4\r\n", {0: [1.0, 3.0], 1: [2.0, 4.0]}),
        ("9007199254740989,1e22\n", {0: [9007199254740989.0], 1: [1e22]}),
        ("1e-22,123456789012345e-20\n", {0: [1e-22], 1: [123456789012345e-20]}),
        ("", {0: [], 1: []}),
    ],
)
def test_what_is_plain_is_read(text: str, columns) -> None:
    rows = rows_of(text)
    expected = {i: np.array(values, np.float64) for i, values in columns.items()}
    same(_plain(rows, [0, 1]), expected)
    if text:
        same(_parsed(rows, [0, 1]), expected)


@pytest.mark.parametrize(
    "text",
    [
        *("1,+2\n", "1,.5\n", "1,5.\n", "1,0x10\n", "1,nan\n", "1,inf\n", "1,1e\n", "1,-\n"),
        *("1,1e23\n", "1,1e-23\n", "1,9007199254740990\n", "1,0.12345678901234567\n"),
        *("1,1 2\n", "1,2\t\n", "1,12:00:00\n", "1,2;\n", "1,--2\n", "1,2e99999999999999999\n"),
        *("1\n", "1,2,3\n", "1,2\n1\n", "1,2\n1,2,\n", " \n", '"1",2\n', "1,2\0\n"),
        "1,2\n3,4\r5,6\n",  # more rows than line ends of one kind
    ],
)
def test_what_is_not_plain_is_left_to_others(text: str) -> None:
    assert _plain(rows_of(text), [0, 1]) is None


def test_columns_that_nobody_wants_may_hold_anything() -> None:
    text = rows_of("what,1,x y,2\n,3,,4\n", 4)
    same(_plain(text, [1, 3]), {1: np.array([1.0, 3.0]), 3: np.array([2.0, 4.0])})
    same(_plain(text, [3]), {3: np.array([2.0, 4.0])})


def test_rows_may_end_in_a_separator_with_nothing_behind() -> None:
    same(_plain(rows_of("1,2,\n3,4,\n", more=1), [1]), {1: np.array([2.0, 4.0])})
    assert _plain(rows_of("1,2,\n3,4,5\n", more=1), [1]) is None
    assert _plain(rows_of("1,2,\n3,4\n", more=1), [1]) is None


def test_rows_begin_where_the_head_ends() -> None:
    same(_plain(rows_of("a,b\n1,2\n", start=4), [0]), {0: np.array([1.0])})


def test_a_clock_is_none_of_the_cores() -> None:
    assert _plain(rows_of("1,2\n", clocks=[1]), [0, 1]) is None
    assert _plain(rows_of("12:00:00,2\n", clocks=[0]), [1]) is not None


def test_rows_that_the_core_refuses_are_read_by_the_others() -> None:
    text = rows_of("1,.5\n2,0.12345678901234567\n3,nan\n")
    found = load_rows(text, {"time": 0, "force": 1}).channels
    assert found["time"].tolist() == [1.0, 2.0, 3.0]
    assert found["force"][:2].tolist() == [0.5, 0.12345678901234567]
    assert np.isnan(found["force"][2])


def test_a_log_of_plain_numbers_loads_no_pyarrow() -> None:
    script = (
        "import sys; from damperfit.readers import read_log; "
        f"n = len(read_log({str(SAMPLE)!r}).time); print(n, 'pyarrow' in sys.modules)"
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout.split() == [str(len(read_log(SAMPLE).time)), "False"], done.stderr


@pytest.mark.parametrize(
    ("wanted", "room", "start", "separator"),
    [(0, 4, 0, ","), (2, 3, 0, ","), (1, 1, -1, ","), (1, 1, 5, ","), (1, 1, 0, "\u00e4")],
)
def test_a_wrong_call_is_refused(wanted: int, room: int, start: int, separator: str) -> None:
    columns, values = np.arange(wanted), np.empty(room)
    with pytest.raises(ValueError, match="read_numbers"):
        compiled_core().read_numbers(b"1,2\n", columns, values, start, separator, ".", 2, 2)
