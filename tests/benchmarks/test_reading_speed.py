"""How long reading takes beside pyarrow.csv alone on the same clean file.

Run with ``pytest tests/benchmarks/test_reading_speed.py --benchmark-enable -n 0 -m ""``. The
aim: at most twice pyarrow.csv at a million rows, and 3 ms for a log of 5000.
"""

from __future__ import annotations

import numpy as np
import pytest
from pyarrow import csv

from damperfit.readers import read_log

HEADER = "time_s,displacement_mm,force_N,temperature_degC"


def _write(path, n: int) -> None:
    time = np.arange(n) / 1000.0
    rows = np.column_stack(
        [time, 32.0 * np.sin(9.4 * time), 600.0 * np.cos(9.4 * time), np.full(n, 26.1)]
    )
    np.savetxt(
        path, rows, fmt=["%.3f", "%.4f", "%.2f", "%.1f"], delimiter=",", header=HEADER, comments=""
    )


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "setting_1.csv"
    _write(path, 5000)
    return path


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "setting_2.csv"
    _write(path, 1_000_000)
    return path


def test_a_log_of_5000_rows(benchmark, small) -> None:
    recording = benchmark(read_log, small)
    assert (recording.setting, len(recording.time)) == (1, 5000)
    assert recording.force[0] == 600.0


@pytest.mark.slow
@pytest.mark.benchmark(group="a million rows")
def test_a_million_rows(benchmark, large) -> None:
    recording = benchmark(read_log, large)
    assert (recording.setting, len(recording.time)) == (2, 1_000_000)
    assert recording.time[-1] == 999.999


@pytest.mark.slow
@pytest.mark.benchmark(group="a million rows")
def test_a_million_rows_by_pyarrow_alone(benchmark, large) -> None:
    table = benchmark(csv.read_csv, large)
    assert table.num_rows == 1_000_000
