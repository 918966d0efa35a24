"""How long reading takes beside pyarrow.csv alone on the same clean file."""

import gzip
import time
import zlib

import numpy as np
import pytest
from pyarrow import csv

from damperfit.io import read_log
from damperfit.io.files import Source, unpack

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
def test_a_million_rows_cost_less_than_twice_pyarrow_alone(large) -> None:
    """In pairs, one beside the other, as the machine may be busy; the medians of the ratios."""
    pairs = []
    for _ in range(21):
        read, recording = _cost(read_log, large)
        parsed, table = _cost(csv.read_csv, large)
        pairs.append([ours / theirs for ours, theirs in zip(read, parsed, strict=True)])
        assert (recording.setting, len(recording.time)) == (2, table.num_rows)
        assert recording.time[-1] == 999.999
    wall, processor = np.median(pairs[1:], axis=0)  # the first pair loads libraries
    print(f"\nread_log / pyarrow.csv: {wall:.2f} by the clock, {processor:.2f} of the processor")
    assert processor < 2.0
    assert wall < 2.0


@pytest.mark.slow
def test_unpacking_beside_zlib_alone_at_any_size() -> None:
    """The ratio stays where it is as the size grows; it was 0.9 at 10 MB and 3.8 at 85 MB."""
    print()
    for megabytes in (10, 20, 40, 85):
        digits = np.random.default_rng(0).integers(48, 64, megabytes * 1_000_000, dtype=np.uint8)
        packed = gzip.compress(digits.tobytes(), 1)
        source = Source("log.csv.gz", "log.csv.gz", packed, "")
        pairs = []
        for _ in range(5):
            ours, (log, _) = _cost(lambda one: unpack(one, max_bytes=10**9), source)
            alone, plain = _cost(lambda one: zlib.decompress(one.data, 31), source)
            pairs.append(ours[1] / alone[1])
        assert log.data == plain
        print(f"{megabytes} MB: {np.median(pairs):.2f} times zlib alone")


def _cost(read, path):
    wall, processor = time.perf_counter(), time.process_time()
    result = read(path)
    return (time.perf_counter() - wall, time.process_time() - processor), result
