"""What readers count and where they stop: the last byte, cell or channel that is still right."""

from __future__ import annotations

import io
import struct

import numpy as np
import pytest

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_log, read_logs
from tests.io import binary_logs, mdf_writer
from tests.io.binary_logs import needs
from tests.io.scenarios import Scenario

SCENARIO = Scenario()


@pytest.fixture
def put(tmp_path):
    def write(data: bytes, name: str):
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write


def refusal(path, options: ReadOptions = ReadOptions()) -> str:
    with pytest.raises(LogError) as caught:
        read_logs(path, options)
    return str(caught.value)


# Excel: the text that cells name by number.


# TDMS: what follows the last segment.


def test_an_empty_segment_at_the_end_is_a_whole_one(put) -> None:
    pytest.importorskip("nptdms")
    data = binary_logs.tdms(SCENARIO)
    empty = b"TDSm" + struct.pack("<IIQQ", 0, 4713, 0, 0)
    assert len(empty) == 28
    force = read_log(put(data + empty, "a_s1.tdms")).force
    np.testing.assert_array_equal(force, SCENARIO.force_n)
    for n_bytes in (27, 1):
        said = refusal(put(data + empty[:n_bytes], "a_s1.tdms"))
        assert f"the segment at byte {len(data)} is not whole" in said
    assert f"no segment at byte {len(data)}" in refusal(put(data + b"T" + bytes(3), "a_s1.tdms"))


# MDF and HDF5: what is no channel stands between those that are.


def test_a_channel_of_text_hides_none_behind_it(put) -> None:
    needs("asammdf")
    time = np.arange(9.0)
    text = ("note", "", np.array([b"abc"] * 9))
    numbers = ("displacement", "mm", 2.0 * time), ("force", "N", 3.0 * time)
    path = put(mdf_writer.written((time, [text, *numbers])), "a_s1.mf4")
    recording = read_log(path, ReadOptions(max_bytes=10_000))
    np.testing.assert_array_equal(recording.time, time)
    np.testing.assert_array_equal(recording.force, 3.0 * time)


@pytest.mark.parametrize("spare", [0, -1])
def test_the_limit_counts_all_vectors_of_a_file(put, spare) -> None:
    h5py = pytest.importorskip("h5py")
    sink = io.BytesIO()
    n = 5000
    with h5py.File(sink, "w") as file:
        for name in ("displacement_mm", "force_N", "time_s"):
            values = np.arange(float(n))[None, :]
            file.create_dataset(name, data=values, compression="gzip", chunks=(1, n))
    path = put(sink.getvalue(), "a_s1.mat")
    limit = 3 * 8 * n + spare
    assert path.stat().st_size < limit
    if spare == 0:
        assert len(read_log(path, ReadOptions(max_bytes=limit)).force) == n
    else:
        assert f"the file up to 'time_s' claims {3 * 8 * n} bytes" in refusal(
            path, ReadOptions(max_bytes=limit)
        )


# Groups of channels, as TDMS and MDF have them.


TEST = ("time_s", "displacement_mm", "force_N")


# Bytes that come in pieces, of a file or out of a packed variable.


# Tests in one file.


@pytest.mark.parametrize(("n", "is_read"), [(1000, True), (1001, False)])
def test_more_than_a_thousand_tests_are_a_clock_that_jumps(put, n, is_read) -> None:
    rows = "".join(f"{100 * k + i},{i},{i}\n" for k in range(n) for i in range(2))
    path = put(f"time_s,displacement_mm,force_N\n{rows}".encode(), "a_s1.csv")
    options = ReadOptions(pause=50.0)
    if is_read:
        assert len(read_logs(path, options)) == n
    else:
        assert f"time jumps {n - 1} times" in refusal(path, options)


# Text: what a row or a declaration gets wrong.


def test_a_declared_column_that_is_not_there_is_told_with_the_nearest(put) -> None:
    path = put(b"time_s,displacement_mm,Load cell N,other_N\n0,1,2,3\n1,2,3,4\n", "a_s1.csv")
    said = refusal(path, ReadOptions(columns={"force": "Load cel N"}))
    assert said.endswith("Did you mean 'Load cell N'?")
    assert "Did you mean" not in refusal(path, ReadOptions(columns={"force": "zzz"}))


def test_a_row_whose_quote_does_not_close_is_dropped_whatever_it_holds(put) -> None:
    lines = ["0,0,0,ok", '1,1,1,"no end', '2,2,2,"said, twice"', "3,3,3,ok"]
    path = put(
        "\n".join(["time_s,displacement_mm,force_N,remark", *lines, ""]).encode(), "a_s1.csv"
    )
    recording = read_log(path, ReadOptions(bad_rows="drop"))
    assert list(recording.time) == [0.0, 2.0, 3.0]
    (found,) = recording.findings
    assert (found.name, found.value) == ("rows_dropped", 1.0)
    assert found.sentence.endswith("a_s1.csv, line 3: a quote opens and does not close in the line")


def test_a_table_without_rows_is_no_log(tmp_path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    path = tmp_path / "a_s1.parquet"
    for n in (0, 2):
        parquet.write_table(pa.table({name: np.arange(float(n)) for name in TEST}), path)
        if n:
            assert len(read_log(path).force) == n
        else:
            assert refusal(path).startswith("a_s1.parquet: no data rows")


@pytest.mark.parametrize("field", ["", "nan", "-inf", "1e999", "x"])
def test_one_row_that_says_no_number_is_dropped_alone(put, field) -> None:
    lines = ["0,0,0", f"1,1,{field}", "2,2,2", "3,3,3"]
    path = put("\n".join(["time_s,displacement_mm,force_N", *lines, ""]).encode(), "a_s1.csv")
    recording = read_log(path, ReadOptions(bad_rows="drop"))
    assert list(recording.force) == [0.0, 2.0, 3.0]
    assert [found.value for found in recording.findings] == [1.0]
