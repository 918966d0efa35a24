"""What a reader must not do, each guard by the log that passes it when it is taken away."""

from __future__ import annotations

import io
import itertools

import numpy as np
import pytest
from scipy import io as scipy_io

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_log

UNITS = {"time": "s", "displacement": "mm", "force": "N"}


@pytest.fixture
def put(tmp_path):
    def write(data: bytes, name: str):
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write


# The setting: declared for the parts, in the preamble, in a column, in the file's name.


def said_by(ways: tuple[str, ...]) -> tuple[bytes, str]:
    """A log whose preamble, column and name say 11, 12 and 13, as far as they are asked to."""
    head = "# setting: 11\n" if "preamble" in ways else ""
    names, field = (",setting", ",12") if "column" in ways else ("", "")
    rows = "".join(f"{i},{i},{i}{field}\n" for i in range(4))
    text = f"{head}time_s,displacement_mm,force_N{names}\n{rows}"
    return text.encode(), "log_s13.csv" if "name" in ways else "log.csv"


ORDER = {"option": 9, "parts": 10, "preamble": 11, "column": 12, "name": 13}


@pytest.mark.parametrize(
    "ways", [w for n in range(6) for w in itertools.combinations(ORDER, n)], ids="-".join
)
def test_the_setting_is_taken_from_the_first_that_says_it(put, ways) -> None:
    options = ReadOptions(
        setting=9 if "option" in ways else None, part_settings=(10,) if "parts" in ways else ()
    )
    data, name = said_by(ways)
    assert read_log(put(data, name), options).setting == (ORDER[ways[0]] if ways else None)


def test_a_log_says_what_was_declared_before_the_log_itself(put) -> None:
    data, name = said_by(("preamble", "name"))
    assert "setting: 11 of the preamble; the file name says 13: check which is right" in (
        read_log(put(data, name)).notes
    )


def test_content_tells_the_format_and_not_the_suffix(put) -> None:
    text, _ = said_by(())
    assert len(read_log(put(text, "log.mat")).force) == 4
    column = np.arange(5.0)[:, None]
    sink = io.BytesIO()
    scipy_io.savemat(sink, {"time_s": column, "displacement_mm": column, "force_N": column})
    assert len(read_log(put(sink.getvalue(), "log.csv")).force) == 5


# Matrices: as many columns as channels, and more rows than columns.


def matlab(name: str, matrix: np.ndarray) -> bytes:
    sink = io.BytesIO()
    scipy_io.savemat(sink, {name: matrix})
    return sink.getvalue()


def matlab_73(name: str, matrix: np.ndarray) -> bytes:
    h5py = pytest.importorskip("h5py")
    sink = io.BytesIO()
    with h5py.File(sink, "w") as file:
        file[name] = matrix.T
    return sink.getvalue()


COLUMNS = {"time": "m:1", "displacement": "m:2", "force": "m:3"}


@pytest.mark.parametrize("write", [matlab, matlab_73])
@pytest.mark.parametrize(
    ("n_rows", "n_columns", "is_read"),
    [
        (4, 3, True),  # one row more than columns
        (3, 3, False),  # nothing tells which way it lies
        (3, 20, False),  # wider than long: its rows would be taken for columns
        (65, 64, True),
        (66, 65, False),  # more than any rig has channels
    ],
)
def test_a_matrix_is_channels_side_by_side(put, write, n_rows, n_columns, is_read) -> None:
    matrix = np.arange(float(n_rows * n_columns)).reshape(n_rows, n_columns)
    path = put(write("m", matrix), "log_s1.mat")
    options = ReadOptions(columns=COLUMNS, units=UNITS)
    if is_read:
        recording = read_log(path, options)
        np.testing.assert_array_equal(recording.time, matrix[:, 0])
        np.testing.assert_array_equal(recording.force, matrix[:, 2])
    else:
        with pytest.raises(LogError, match=r"no (vectors|channels) of numbers"):
            read_log(path, options)


@pytest.mark.parametrize("write", [matlab, matlab_73])
@pytest.mark.parametrize("shape", [(2, 1), (1, 2), (1, 1), (0, 3), (2, 2, 2)])
def test_a_vector_is_two_numbers_or_more_either_way(put, write, shape) -> None:
    path = put(write("force_N", np.ones(shape)), "log_s1.mat")
    is_vector = max(shape) == 2 and len(shape) == 2
    says = "no column for time" if is_vector else r"no (vectors|channels) of numbers"
    with pytest.raises(LogError, match=says):
        read_log(path)


# HDF5: nothing is read that stands in another file.


@pytest.fixture
def hdf5(tmp_path):
    """Write a log whose force is told elsewhere, in a file that can be read."""
    h5py = pytest.importorskip("h5py")
    values = np.arange(6.0)[None, :]
    elsewhere = tmp_path / "elsewhere.h5"
    with h5py.File(elsewhere, "w") as file:
        file["force_N"] = values
    (tmp_path / "elsewhere.bin").write_bytes(values.tobytes())

    def write(put_force) -> object:
        sink = io.BytesIO()
        with h5py.File(sink, "w") as file:
            file["time_s"] = values
            file["displacement_mm"] = values
            put_force(h5py, file, elsewhere)
        path = tmp_path / "log_s1.mat"
        path.write_bytes(sink.getvalue())
        return path

    return write


def _own(h5py, file, elsewhere) -> None:
    file["force_N"] = np.arange(6.0)[None, :]


def _external_link(h5py, file, elsewhere) -> None:
    file["force_N"] = h5py.ExternalLink(str(elsewhere), "/force_N")


def _soft_link(h5py, file, elsewhere) -> None:
    file["hidden/force"] = np.arange(6.0)[None, :]
    file["force_N"] = h5py.SoftLink("/hidden/force")


def _external_values(h5py, file, elsewhere) -> None:
    place = str(elsewhere.with_suffix(".bin"))
    file.create_dataset("force_N", (1, 6), "f8", external=[(place, 0, 48)])


def _virtual(h5py, file, elsewhere) -> None:
    layout = h5py.VirtualLayout((1, 6), "f8")
    layout[:] = h5py.VirtualSource(str(elsewhere), "force_N", (1, 6))
    file.create_virtual_dataset("force_N", layout)


def test_the_log_is_good_where_the_force_is_its_own(hdf5) -> None:
    assert list(read_log(hdf5(_own)).force) == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


@pytest.mark.parametrize("put_force", [_external_link, _soft_link, _external_values, _virtual])
def test_no_value_is_taken_from_another_file(hdf5, put_force) -> None:
    with pytest.raises(LogError, match="no column for force"):
        read_log(hdf5(put_force))


# Times of a Parquet log in ticks of every size.


@pytest.mark.parametrize(
    ("tick", "seconds"), [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)]
)
@pytest.mark.parametrize("kind", ["timestamp", "duration", "time"])
def test_a_tick_is_as_long_as_it_says(tmp_path, tick, seconds, kind) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    if (kind, tick) == ("time", "s"):  # Parquet stores it in milliseconds
        pytest.skip("no such column in Parquet")
    of_time = pa.time32 if tick == "ms" else pa.time64
    of_kind = {"timestamp": pa.timestamp, "duration": pa.duration, "time": of_time}[kind](tick)
    ticks = [7, 10, 13, 17]
    table = pa.table(
        {
            "time": pa.array(ticks, of_kind),
            "displacement_mm": [0.0, 1.0, 2.0, 3.0],
            "force_N": [0.0, 1.0, 2.0, 3.0],
        }
    )
    path = tmp_path / "log_s1.parquet"
    parquet.write_table(table, path)
    first = 0 if kind == "duration" else 7
    expected = seconds * (np.array(ticks) - first)
    np.testing.assert_allclose(read_log(path).time, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("unit", "seconds"), [("ms", 1e-3), ("msec", 1e-3), ("us", 1e-6), ("min", 60.0)]
)
def test_a_column_of_time_is_in_its_unit(put, unit, seconds) -> None:
    data = f"time_{unit},displacement_mm,force_N\n0,1,2\n1,1,2\n3,1,2\n".encode()
    options = ReadOptions(pause=1e4)
    np.testing.assert_allclose(read_log(put(data, "log_s1.csv"), options).time[-1], 3.0 * seconds)
