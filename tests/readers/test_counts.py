"""What readers count and where they stop: the last byte, cell or channel that is still right."""

from __future__ import annotations

import io
import logging
import struct

import numpy as np
import pytest

from damperfit.errors import LogError
from damperfit.readers import ReadOptions, excel, read_log, read_logs
from damperfit.readers.foreign import load_library
from tests.readers import binary_logs
from tests.readers.scenarios import Scenario

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


def test_a_library_is_silenced_and_no_other(monkeypatch) -> None:
    own = ("colorsys", "colorsys.inside")
    others = ("colorsysmore", "other.colorsys", "other")
    before = {name: logging.getLogger(name).level for name in (*own, *others)}
    try:
        for name in before:
            logging.getLogger(name).setLevel(logging.INFO)
        load_library("colorsys", extra="x", reads="X", name="a")
        levels = {name: logging.getLogger(name).level for name in before}
        assert all(levels[name] > logging.CRITICAL for name in own)
        assert all(levels[name] == logging.INFO for name in others)
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)


# Excel: the text that cells name by number.


@pytest.mark.parametrize(
    ("cells", "n_bytes"),
    [
        ("", 0),
        ('<c t="s"><v>0</v></c>', 10),
        ('<c t="s"><v>0</v></c><c t="s"><v>2</v></c>', 13),
        ("<c><v>1</v></c>", 0),  # a number
        ('<c t="s"><v>3</v></c>', 0),  # there is no fourth text
        ('<c t="s"><f>A1</f><v>0</v></c>', 500),  # not understood: the longest
        ('<c t="s"><v>2</v></c><c t="s"><f>A1</f><v>0</v></c>', 503),
    ],
)
def test_a_cell_counts_the_text_it_names_or_the_longest(cells, n_bytes) -> None:
    assert excel._named_text(cells.encode(), [10, 500, 3]) == n_bytes


def test_a_column_is_numbered_by_its_letters() -> None:
    letters = (b"A", b"b", b"Z", b"AA", b"AB", b"ZZ", b"XFD")
    assert [excel._column(one) for one in letters] == [1, 2, 26, 27, 28, 702, 16384]


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
    asammdf = pytest.importorskip("asammdf")
    time = np.arange(9.0)
    names = ("note", "displacement", "force")
    units = ("", "mm", "N")
    values = (np.array([b"abc"] * 9), 2.0 * time, 3.0 * time)
    with asammdf.MDF(version="4.10") as file:
        file.append(
            [
                asammdf.Signal(one, time, unit, name, encoding="utf-8")
                if one.dtype.kind == "S"
                else asammdf.Signal(one, time, unit, name)
                for name, unit, one in zip(names, units, values, strict=True)
            ]
        )
        sink = io.BytesIO()
        file.save(sink)
    recording = read_log(put(sink.getvalue(), "a_s1.mf4"))
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
