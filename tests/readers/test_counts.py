"""What readers count and where they stop: the last byte, cell or channel that is still right."""

from __future__ import annotations

import io
import logging
import struct
import zlib

import numpy as np
import pytest

from damperfit.errors import LogError
from damperfit.readers import ReadOptions, excel, matlab, mdf, read_log, read_logs, rows
from damperfit.readers.files import Source, _read_up_to
from damperfit.readers.foreign import load_library
from damperfit.readers.grouping import (
    Group,
    GroupChannel,
    group_tables,
    read_groups_in_child,
)
from tests.readers import binary_logs, mdf_writer
from tests.readers.binary_logs import needs
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


def test_a_library_is_silenced_and_no_other() -> None:
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
    needs("asammdf")
    time = np.arange(9.0)
    text = ("note", "", np.array([b"abc"] * 9))
    numbers = ("displacement", "mm", 2.0 * time), ("force", "N", 3.0 * time)
    path = put(mdf_writer.written(time, [text, *numbers]), "a_s1.mf4")
    source = Source(path.name, str(path), path.read_bytes(), str)
    options = ReadOptions(max_bytes=10_000)
    (group,) = read_groups_in_child(mdf.__name__, "asammdf", source, options)
    assert [one.name for one in group.channels] == ["time", "displacement", "force"]
    recording = read_log(path)
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


def group(name: str, *channels: str, is_cut: bool = False, n: tuple[int, ...] = ()) -> Group:
    lengths = n or (9,) * len(channels)
    return Group(
        name,
        tuple(
            GroupChannel(one, None, k, lambda k=k: np.arange(float(k)))
            for one, k in zip(channels, lengths, strict=True)
        ),
        is_cut=is_cut,
    )


TEST = ("time_s", "displacement_mm", "force_N")


@pytest.mark.parametrize(
    ("groups", "n_tests", "left_out"),
    [
        ((group("a", *TEST),), 1, ""),
        ((group("a", *TEST), group("b", *TEST)), 2, ""),
        ((group("a", *TEST), group("b", "noise")), 1, "b"),
        ((group("a", *TEST[:2]), group("b", TEST[2])), 1, ""),  # a test together
        ((group("a", *TEST), group("b")), 1, ""),  # no numbers, nothing lost
    ],
)
def test_groups_that_are_no_tests_are_named(groups, n_tests, left_out) -> None:
    tables = group_tables(groups, ReadOptions(), name="a")
    assert len(tables) == n_tests
    said = [note for table in tables for note in table.notes if "left out" in note]
    assert said == ([f"groups left out, as they are not tests: {left_out!r}"] if left_out else [])


@pytest.mark.parametrize(("is_cut", "last"), [(True, 8), (True, 9), (False, 9), (False, 8)])
def test_channels_of_different_length_are_kept_of_a_cut_file_alone(is_cut, last) -> None:
    (table,) = group_tables(
        [group("a", *TEST, is_cut=is_cut, n=(9, 9, last))], ReadOptions(), name="a"
    )
    wanted = {"time": 0, "displacement": 1, "force": 2}
    if last == 8 and not is_cut:
        with pytest.raises(LogError, match="different length: time 9, displacement 9, force 8"):
            table.load(wanted)
        return
    samples = table.load(wanted)
    assert {len(values) for values in samples.channels.values()} == {last}
    assert any(f"the first {last} values" in note for note in samples.notes) is (last == 8)


# Bytes that come in pieces, of a file or out of a packed variable.


class Slow(io.BytesIO):
    """A file that gives three bytes at a time, as one on a network may."""

    def read(self, n: int = -1) -> bytes:
        return super().read(min(n, 3))


@pytest.mark.parametrize("n", [0, 2, 3, 4, 10, 11, 50])
def test_a_file_that_is_read_in_pieces_is_read_whole_up_to_the_limit(n) -> None:
    assert _read_up_to(Slow(b"0123456789"), n) == b"0123456789"[:n]


def test_the_first_bytes_of_a_variable_are_kept_and_all_are_counted() -> None:
    whole = bytes(range(256)) * (3 * matlab._CHUNK // 256)
    packed = zlib.compress(whole)
    for keep in (10, matlab._CHUNK, matlab._CHUNK + 5, len(whole), len(whole) + 1):
        kept, total = matlab._unpack(packed, name="a", limit=len(whole), keep=keep)
        assert (kept, total) == (whole[:keep], len(whole))
    with pytest.raises(LogError, match="more than the limit"):
        matlab._unpack(packed, name="a", limit=len(whole) - 1, keep=10)


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


@pytest.mark.parametrize(
    ("times", "is_fast"),
    [
        (("0", "1", "2"), True),
        (("11:56:20.0", "11:56:21.0", "11:56:22.0"), True),
        (("0", "1", "2 s"), False),
    ],
)
def test_rows_are_read_one_by_one_only_where_something_is_wrong(
    put, monkeypatch, times, is_fast
) -> None:
    def slow(*_):
        raise LogError("one by one")

    monkeypatch.setattr(rows, "_load_slow", slow)
    text = "".join(f"{time},{i},{i}\n" for i, time in enumerate(times))
    path = put(f"time_s,displacement_mm,force_N\n{text}".encode(), "a_s1.csv")
    if is_fast:
        assert list(read_log(path).time) == [0.0, 1.0, 2.0]
    else:
        assert refusal(path) == "one by one"


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


def block(kind: bytes, *links: int) -> bytes:
    head = kind + bytes(4) + struct.pack("<QQ", 24 + 8 * len(links), len(links))
    return head + struct.pack(f"<{len(links)}Q", *links)


@pytest.mark.parametrize("n_links", [1, 2])
def test_a_block_of_mdf_that_two_name_hides_no_damage_behind_it(n_links) -> None:
    first = mdf._FIRST_BLOCK
    text = first + 24 + 8 * (1 + n_links)
    last = text + 24
    data = bytes(first) + block(b"##HD", last, *[text] * n_links) + block(b"##TX")
    mdf._check_blocks(data + block(b"##TX"), name="a", limit=1)
    with pytest.raises(LogError, match=f"no block at byte {last}"):
        mdf._check_blocks(data + bytes(24), name="a", limit=1)
    with pytest.raises(LogError, match="truncated"):
        mdf._check_blocks(data + block(b"##TX")[:-1], name="a", limit=1)


@pytest.mark.parametrize("field", ["", "nan", "-inf", "1e999", "x"])
def test_one_row_that_says_no_number_is_dropped_alone(put, field) -> None:
    lines = ["0,0,0", f"1,1,{field}", "2,2,2", "3,3,3"]
    path = put("\n".join(["time_s,displacement_mm,force_N", *lines, ""]).encode(), "a_s1.csv")
    recording = read_log(path, ReadOptions(bad_rows="drop"))
    assert list(recording.force) == [0.0, 2.0, 3.0]
    assert [found.value for found in recording.findings] == [1.0]
