"""Limits of what a reader takes: a case just inside, one just outside."""

from __future__ import annotations

import hashlib
import struct
import zipfile
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.errors import ConfigurationError, LogError
from damperfit.readers import assembly, files, force_curves, json_log, mdf
from damperfit.readers.delimited import _blocks
from damperfit.readers.dialect import _head, find_dialect
from damperfit.readers.encoding import is_binary
from damperfit.readers.excel import _check_archive
from damperfit.readers.grouping import Group, GroupChannel, _makes_time
from damperfit.readers.hdf5 import _channels
from damperfit.readers.options import ReadOptions
from damperfit.readers.rows import _number
from damperfit.readers.tdms_segments import find_extent
from damperfit.readers.tests_table import read_tests
from damperfit.readers.write_buffers import _breaks

OPTIONS = ReadOptions()
SOURCE = SimpleNamespace(name="a.csv", data=b"{}")


def refusal(call, *arguments, **words) -> str:
    """What a call refuses with; empty where it does not."""
    try:
        call(*arguments, **words)
    except (LogError, ConfigurationError) as error:
        return str(error)
    return ""


# Text


@pytest.mark.parametrize(("before", "binary"), [(4000, True), (4200, False)])
def test_the_first_four_thousand_bytes_tell_binary_data(before, binary) -> None:
    assert is_binary(b"a" * before + b"\x01") is binary


@pytest.mark.parametrize(("length", "refused"), [(255_000, False), (270_000, True)])
def test_a_line_ends_within_a_quarter_of_a_megabyte(length, refused) -> None:
    data = b"a" * length + b"\n" + b"1,2\n" * 6000
    assert ("longer than 262144 bytes" in refusal(_head, data, 40, "a.csv", 1)) is refused


@pytest.mark.parametrize(("columns", "refused"), [(1950, False), (2050, True)])
def test_two_thousand_columns_are_a_table(columns, refused) -> None:
    data = b"\n".join([b",".join([b"1.5"] * columns)] * 3)
    said = refusal(find_dialect, data, OPTIONS, name="a.csv")
    assert ("more than the limit of 2000" in said) is refused


@pytest.mark.parametrize(("above", "title"), [(96_000, True), (104_000, False)])
def test_a_preamble_has_a_hundred_thousand_bytes(above, title) -> None:
    data = b"x" * (above - 1) + b"\nData Acquisition: cyclic\n1,2\n"
    (block,) = _blocks(data, 1, "a.csv")
    assert (len(block.data) < 10) is title


@pytest.mark.parametrize(("n", "said"), [(3, False), (4, True)])
def test_three_breaks_of_a_record_are_told_one_by_one(n, said) -> None:
    runs = [[SimpleNamespace(time=np.array([10.0 * k, 10.0 * k + 1.0]))] for k in range(n + 1)]
    assert ("; and 1 more" in _breaks(runs, range(n + 1))) is said


@pytest.mark.parametrize(("size", "said"), [(9_600_000, "is empty"), (10_400_000, "larger than")])
def test_a_table_of_tests_has_ten_megabytes(size, said) -> None:
    path = SimpleNamespace(stat=lambda: SimpleNamespace(st_size=size), read_bytes=lambda: b"")
    assert said in refusal(read_tests, path, ("setting",))


# Tests of one file


def parts(time):
    samples = SimpleNamespace(channels={}, place=str)
    channels = {"force": np.zeros(len(time)), "time": np.asarray(time)}
    return assembly._cuts(samples, channels, OPTIONS, "a.csv")


@pytest.mark.parametrize(("pause", "n"), [(1.95, 1), (2.05, 2)])
def test_a_pause_of_two_seconds_begins_another_test(pause, n) -> None:
    time = np.arange(40) * 0.01
    time[20:] += pause - 0.01
    assert len(parts(time)) == n


@pytest.mark.parametrize(("tests", "refused"), [(960, False), (1040, True)])
def test_a_clock_that_jumps_a_thousand_times_is_broken(tests, refused) -> None:
    time = np.repeat(10.0 * np.arange(tests), 4) + np.tile(0.01 * np.arange(4), tests)
    assert ("a faulty clock" in refusal(parts, time)) is refused


# Curves without time


@pytest.mark.parametrize(("n", "branches"), [(49, 1), (50, 2)])
def test_fifty_points_of_a_stroke_are_a_loop(n, branches) -> None:
    speed = np.sin(np.linspace(0.0, np.pi, n))
    curve = SimpleNamespace(points=lambda _: (speed, speed))
    assert len(force_curves.ForceCurve._branches(curve, "rebound")) == branches


@dataclass(frozen=True)
class _Curve:
    notes: tuple[str, ...] = ()


@pytest.mark.parametrize(("n", "refused"), [(480, False), (520, True)])
def test_a_file_has_five_hundred_curves(n, refused, monkeypatch) -> None:
    monkeypatch.setattr(force_curves, "has_channel", lambda *_: False)
    monkeypatch.setattr(force_curves, "_table_curves", lambda *_: [_Curve()] * n)
    table = SimpleNamespace(columns=())
    said = refusal(force_curves.make_curves, [table], SOURCE, OPTIONS, ())
    assert (f"{n} curves, more than the limit" in said) is refused


# Binary formats


@pytest.mark.parametrize(("n", "refused"), [(9_600, False), (10_400, True)])
def test_a_workbook_has_ten_thousand_members(n, refused, monkeypatch) -> None:
    members = [SimpleNamespace(filename="xl/workbook.xml", file_size=1)] * n

    class Archive:
        def __init__(self, _):
            pass

        def __enter__(self):
            return SimpleNamespace(infolist=lambda: members)

        def __exit__(self, *_):
            return None

    monkeypatch.setattr(zipfile, "ZipFile", Archive)
    assert ("expected a workbook of few" in refusal(_check_archive, SOURCE, OPTIONS)) is refused


@pytest.mark.parametrize(("n", "read"), [(64, 64), (65, 0)])
def test_a_matrix_has_sixty_four_channels(n, read) -> None:
    plist = SimpleNamespace(get_external_count=lambda: 0)

    class Data:
        attrs, shape, ndim = {}, (n, 100), 2
        dtype, is_virtual = np.dtype(float), False
        id = SimpleNamespace(get_create_plist=lambda: plist)

        def __getitem__(self, _):
            return np.zeros(self.shape)

    assert len(list(_channels(Data(), "log", 0, 10**9))) == read


LOG = {"time_s": [0.0, 0.1], "displacement_mm": [1.0, 2.0], "force_N": [1.0, 2.0]}


@pytest.mark.parametrize(
    ("document", "parts"),
    [
        ({"a": {"b": LOG}}, ["b"]),
        ({"a": {"b": {"c": LOG}}}, []),  # three names deep
    ],
)
def test_a_table_stands_two_names_deep(document, parts) -> None:
    assert [part for part, *_ in json_log._tables(document, {}, "a.json")] == parts


@pytest.mark.parametrize(("n", "refused"), [(960, False), (1040, True)])
def test_a_document_has_a_thousand_tables(n, refused, monkeypatch) -> None:
    class Values:
        def __init__(self, *_):
            pass

        def table(self, *_):
            return None

    monkeypatch.setattr(json_log, "_tables", lambda *_: [("", {}, {})] * n)
    monkeypatch.setattr(json_log, "_Values", Values)
    assert (
        "more than the limit of 1000" in refusal(json_log.read_json, SOURCE, OPTIONS)
    ) is refused


@pytest.mark.parametrize(("n", "refused"), [(1_000_000, False), (1_000_001, True)])
def test_a_file_has_a_million_blocks(n, refused) -> None:
    assert ("more than 1000000 blocks" in refusal(mdf._refuse_many, n, "a.mf4")) is refused


# What is left of a channel, a file, a cell


@pytest.mark.parametrize(("n_values", "n_missing"), [(-10, -1), (0, 80), (30, 50)])
def test_what_a_cut_segment_misses_is_known_where_its_values_begin(n_values, n_missing) -> None:
    """A segment with 80 bytes of values behind 40 that say what they are."""
    lead_in = b"TDSm" + struct.pack("<IIQQ", 0b1010, 4713, 120, 40)  # has both
    data = (lead_in + bytes(120))[: len(lead_in) + 40 + n_values]
    found = find_extent(data, name="a.tdms")
    assert (found.n_stored, found.cut_at, found.n_missing) == (max(n_values, 0), 0, n_missing)


def test_a_channel_without_a_unit_is_left_out_and_no_other() -> None:
    kilo = SimpleNamespace(unit=SimpleNamespace(to_si=lambda values: 1e3 * values))
    choices = {"setting": SimpleNamespace(unit=None), "force": kilo, "displacement": kilo}
    samples = SimpleNamespace(channels={name: np.arange(3.0) for name in choices})
    found = assembly._si_channels(samples, choices, OPTIONS, "a.csv")
    assert {name: values.tolist() for name, values in found.items()} == {
        "force": [0.0, 1e3, 2e3], "displacement": [0.0, 1e3, 2e3],
    }  # fmt: skip


@pytest.mark.parametrize("beside", [1, 100])
def test_a_large_log_has_the_hash_of_its_bytes(beside, monkeypatch) -> None:
    monkeypatch.setattr(files, "_HASHED_BESIDE", beside)
    assert files._hashed(b"0 1 2\n")() == hashlib.sha256(b"0 1 2\n").hexdigest()


@pytest.mark.parametrize(
    ("others", "makes"),
    [
        ((("force", None),), True),
        ((("force", 0.001),), True),
        ((("force", None), ("time", None)), False),
    ],
)
def test_one_interval_makes_a_time_that_no_channel_holds(others, makes) -> None:
    channels = [
        GroupChannel(name, None, 3, lambda: np.zeros(3), interval=interval)
        for name, interval in (("displacement", 0.001), *others)
    ]
    assert _makes_time(Group("", tuple(channels))) is makes
    assert not _makes_time(Group("", tuple(replace(one, interval=None) for one in channels)))


def test_an_empty_cell_is_no_number_and_a_word_is_none() -> None:
    text = SimpleNamespace(
        declared=SimpleNamespace(thousands=""), dialect=SimpleNamespace(decimal="."),
        drops_bad_rows=False,
    )  # fmt: skip
    assert np.isnan(_number(text, "", "force", "row 3"))
    assert _number(text, "1.5", "force", "row 3") == 1.5
    text.drops_bad_rows = True
    assert "row 3: force is '', expected a finite" in refusal(_number, text, "", "force", "row 3")
    assert np.isnan(_number(text, "", "temperature", "row 3"))


@pytest.mark.parametrize(
    ("channels", "rows", "refused"),
    [(4, 100, False), (4, 101, True), (0, 400, False), (0, 401, True)],
)
def test_a_channel_group_claims_its_rows_in_all_of_its_channels(channels, rows, refused) -> None:
    group = SimpleNamespace(
        channels=[None] * channels, channel_group=SimpleNamespace(cycles_nr=rows)
    )
    said = refusal(mdf._check_rows, SimpleNamespace(groups=[group]), 3200)
    assert ("limit of 3200" in said) is refused
