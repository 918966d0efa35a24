"""Binary formats: the arrays that were written, or one line; limits before memory; damage."""

import io
import struct
import sys
import zipfile
from functools import cache

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy import io as scipy_io

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_log, read_logs
from tests.io import binary_logs, scenarios
from tests.io.binary_logs import WRITERS, needs
from tests.io.scenarios import HEADER, Scenario, check_round_trip, parquet_bytes, parquet_table

SCENARIO = Scenario()
NAMES = ("time_s", "displacement_mm", "force_N")
UNITS = {"time": "s", "displacement": "mm", "force": "N"}
CHANNELS = ("time", "displacement", "force")


def refusal(path, **declared) -> str:
    with pytest.raises(LogError) as caught:
        read_logs(path, ReadOptions(**declared))
    assert str(caught.value).isprintable()
    assert path.name in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("writer", scenarios.WRITERS)
def test_every_writer_of_text_and_parquet_and_reader_agree(tmp_path, writer) -> None:
    file_name, write = scenarios.WRITERS[writer]
    check_round_trip(tmp_path, file_name, write(SCENARIO), SCENARIO, ReadOptions())


@pytest.mark.parametrize("writer", WRITERS)
def test_every_writer_and_reader_agree_and_a_cut_file_is_refused(tmp_path, put, writer) -> None:
    file_name, write, needed = WRITERS[writer]
    needs(*needed)
    data = write(SCENARIO)
    check_round_trip(tmp_path, file_name, data, SCENARIO, ReadOptions())
    # HDF5 is read in a process of its own, another one after each refusal: 0.6 s.
    for kept in (len(data) // 2, len(data) - 9)[writer == "MATLAB 7.3" :]:
        refusal(put(data[:kept], file_name))


@pytest.mark.parametrize(
    ("writer", "module", "extra"),
    [
        ("TDMS", "nptdms", "tdms"),
        ("MDF", "asammdf", "mdf"),
        ("MATLAB 7.3", "h5py", "mat73"),
        ("Excel", "python_calamine", "excel"),
    ],
)
def test_a_missing_library_is_one_line_with_the_command(
    put, monkeypatch, writer, module, extra
) -> None:
    file_name, write, needed = WRITERS[writer]
    needs(*needed)
    path = put(write(SCENARIO), file_name)
    monkeypatch.setitem(sys.modules, module, None)
    assert f"pip install 'damperfit[{extra}]'" in refusal(path)


def test_modules_beside_a_log_are_never_imported(tmp_path, put, monkeypatch) -> None:
    pytest.importorskip("h5py")
    for name in ("h5py", "json", "struct"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(7)")
    monkeypatch.chdir(tmp_path)
    path = put(binary_logs.matlab_73(SCENARIO), "a.mat")
    np.testing.assert_array_equal(read_log(path).force, SCENARIO.force_n)


# MATLAB


def saved(variables: dict, *, is_packed: bool = True) -> bytes:
    sink = io.BytesIO()
    scipy_io.savemat(sink, variables, do_compression=is_packed)
    return sink.getvalue()


def hdf5(variables: dict) -> bytes:
    h5py = pytest.importorskip("h5py")
    sink = io.BytesIO()
    with h5py.File(sink, "w") as file:
        for name, values in variables.items():
            file[name] = np.asarray(values).T
    return sink.getvalue()


@pytest.mark.parametrize("is_packed", [True, False])
@pytest.mark.parametrize("kind", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"])
def test_every_kind_of_number_is_read_as_scipy_reads_it(put, kind, is_packed) -> None:
    # MATLAB stores numbers in fewer bytes where they fit; SciPy is the second opinion.
    values = np.arange(60, dtype=kind).reshape(20, 3)
    data = saved({"a": values, "time_s": np.arange(20.0)[:, None], "f": 1.5}, is_packed=is_packed)
    options = ReadOptions(columns={"displacement": "a:1", "force": "a:3"}, units=UNITS)
    recording = read_log(put(data, "a.mat"), options)
    expected = scipy_io.loadmat(io.BytesIO(data))["a"].astype(float)
    np.testing.assert_array_equal(recording.force, expected[:, 2])
    np.testing.assert_array_equal(recording.displacement, expected[:, 0] * 1e-3)
    # "f" is a frequency left over by a script.
    assert "1 variables left out; they are not vectors of 20 numbers" in recording.notes


COLUMN = np.arange(20.0)[:, None]


NOT_REAL = {"time_s": COLUMN, "displacement_mm": COLUMN}


@pytest.mark.parametrize(
    ("variables", "says"),
    [
        ({"a": "text"}, "no vectors of numbers; the file holds 'a' (char)"),
        (
            {"run": {"time_s": np.arange(5.0)}},
            "'run' (struct); save its fields as variables: save(",
        ),
        (NOT_REAL | {"force_N": COLUMN + 1j}, "no column for force"),
        (NOT_REAL | {"force_N": COLUMN.astype(object)}, "no column for force"),
    ],
)
@pytest.mark.parametrize("is_packed", [True, False])
def test_matlab_without_numbers_says_what_it_holds(put, variables, says, is_packed) -> None:
    assert says in refusal(put(saved(variables, is_packed=is_packed), "a.mat"))


@pytest.mark.parametrize("write", [saved, hdf5])
@pytest.mark.parametrize(
    ("shape", "is_read"),
    [
        ((4, 3), True),  # one row more than columns
        ((3, 3), False),  # nothing tells which way it lies
        ((3, 20), False),  # wider than long: its rows would be taken for columns
        *(((65, 64), True), ((66, 65), False)),  # more than any rig has channels
        *(((1, 1), False), ((0, 3), False), ((2, 2, 2), False)),
    ],
)
def test_a_matrix_is_channels_side_by_side(put, write, shape, is_read) -> None:
    matrix = np.arange(float(np.prod(shape))).reshape(shape)
    path = put(write({"m": matrix}), "log_s1.mat")
    columns = {"time": "m:1", "displacement": "m:2", "force": "m:3"}
    if not is_read:
        assert " of numbers" in refusal(path, columns=columns, units=UNITS)
        return
    recording = read_log(path, ReadOptions(columns=columns, units=UNITS))
    np.testing.assert_array_equal(recording.time, matrix[:, 0])
    np.testing.assert_array_equal(recording.force, matrix[:, 2])


@pytest.mark.parametrize("is_packed", [True, False])
def test_the_values_of_a_matlab_file_are_counted_before_they_are_read(put, is_packed) -> None:
    column = np.zeros((100_000, 1))
    path = put(saved(dict.fromkeys(NAMES, column), is_packed=is_packed), "a_s1.mat")
    limit = max(2_399_999, path.stat().st_size * is_packed)
    assert "more than the limit of 2399999 (rig.max_log_bytes)" in refusal(path, max_bytes=limit)


def test_hdf5_that_claims_terabytes_is_refused(put) -> None:
    h5py = pytest.importorskip("h5py")
    sink = io.BytesIO()
    with h5py.File(sink, "w") as file:
        for name in NAMES:  # nothing is stored until something is written
            file.create_dataset(name, shape=(1, 10**12), dtype="f8", chunks=(1, 1000))
    assert "rig.max_log_bytes" in refusal(put(sink.getvalue(), "a.mat"))


@pytest.mark.parametrize("how", ["own", "external link", "soft link", "external values", "virtual"])
def test_no_value_is_taken_from_another_file(tmp_path, put, how) -> None:
    h5py = pytest.importorskip("h5py")
    values = np.arange(6.0)[None, :]
    elsewhere = put(hdf5({"force_N": values.T}), "elsewhere.h5")
    (tmp_path / "elsewhere.bin").write_bytes(values.tobytes())
    sink = io.BytesIO()
    with h5py.File(sink, "w") as file:
        file["time_s"] = file["displacement_mm"] = values
        if how == "own":
            file["force_N"] = values
        elif how == "external link":
            file["force_N"] = h5py.ExternalLink(str(elsewhere), "/force_N")
        elif how == "soft link":
            file["force_N"] = h5py.SoftLink("/time_s")
        elif how == "external values":
            place = str(tmp_path / "elsewhere.bin")
            file.create_dataset("force_N", (1, 6), "f8", external=[(place, 0, 48)])
        else:
            layout = h5py.VirtualLayout((1, 6), "f8")
            layout[:] = h5py.VirtualSource(str(elsewhere), "force_N", (1, 6))
            file.create_virtual_dataset("force_N", layout)
    path = put(sink.getvalue(), "log_s1.mat")
    if how == "own":
        assert list(read_log(path).force) == list(range(6))
    else:
        assert "no column for force" in refusal(path)


# TDMS


def tdms(*channels: tuple, group: str = "run", **facts) -> bytes:
    """A file of one segment; channels are names, values and properties."""
    nptdms = pytest.importorskip("nptdms")
    sink = io.BytesIO()
    with nptdms.TdmsWriter(sink) as writer:
        objects = [nptdms.ChannelObject(group, *one) for one in channels]
        writer.write_segment([nptdms.GroupObject(group, facts), *objects])
    return sink.getvalue()


@pytest.mark.parametrize(
    ("step", "offset", "n"), [(0.002, 0.0, 5), (0.001, 0.003, 6), (0.001, 0.006, 0)]
)
def test_tdms_channels_of_different_rate_or_start_are_read_at_the_times_of_the_force(
    put, step, offset, n
) -> None:
    clock = {"wf_increment": step, "wf_start_offset": offset}
    values = np.arange(9.0)
    data = tdms(("displacement_mm", values, {"wf_increment": 0.001}), ("force_N", values, clock))
    path = put(data, "a.tdms")
    if not n:  # hardly any of it is there at the same time
        assert "different rate or start" in refusal(path)
        return
    recording = read_log(path)
    np.testing.assert_array_equal(recording.force, np.arange(float(n)))
    np.testing.assert_allclose(1e6 * recording.displacement, 1e6 * recording.time)


def test_each_tdms_group_that_is_a_test_is_a_recording(put) -> None:
    nptdms = pytest.importorskip("nptdms")
    sink = io.BytesIO()
    with nptdms.TdmsWriter(sink) as writer:
        for k in (3, 4):
            channels = [
                nptdms.ChannelObject(
                    f"run {k}", name, k * v, {"unit_string": binary_logs.CHANNELS[name]}
                )
                for name, v in binary_logs.arrays(SCENARIO).items()
            ]
            writer.write_segment([nptdms.GroupObject(f"run {k}", {"setting": k}), *channels])
        writer.write_segment([nptdms.ChannelObject("other", "noise", np.arange(4.0))])
    recordings = read_logs(put(sink.getvalue(), "a.tdms"))
    assert [recording.setting for recording in recordings] == [3, 4]
    for k, recording in zip((3, 4), recordings, strict=True):
        np.testing.assert_array_equal(recording.force, k * np.array(SCENARIO.force_n))


def test_tdms_that_claims_more_than_it_holds_is_refused(put) -> None:
    pytest.importorskip("nptdms")
    data, n = binary_logs.tdms(SCENARIO), len(SCENARIO.time)
    index = struct.pack("<IIQ", 10, 1, n)  # type double, dimension 1, n values
    for claimed in (n + 1, n - 1, 10**12, 2**63):
        refusal(put(data.replace(index, struct.pack("<IIQ", 10, 1, claimed), 1), "a.tdms"))


def test_the_end_of_tdms(put) -> None:
    pytest.importorskip("nptdms")
    data = binary_logs.tdms(SCENARIO)
    empty = b"TDSm" + struct.pack("<IIQQ", 0, 4713, 0, 0)
    whole = read_log(put(data + empty, "a_s1.tdms"), ReadOptions(allow_truncated=True))
    np.testing.assert_array_equal(whole.force, SCENARIO.force_n)
    assert whole.findings == ()
    for n_bytes in (27, 1):
        said = refusal(put(data + empty[:n_bytes], "a_s1.tdms"))
        assert f"the segment at byte {len(data)} is not whole" in said
    assert f"no segment at byte {len(data)}" in refusal(put(data + b"T" + bytes(3), "a_s1.tdms"))
    few = refusal(put(data[:-16], "a_s1.tdms"), max_bytes=len(data) - 1)  # and not put back
    assert "16 bytes are missing" in few
    cut = read_log(put(data[:-16], "b.tdms"), ReadOptions(allow_truncated=True))
    assert [(one.code, one.severity) for one in cut.findings] == [("truncated", "warning")]
    assert 0 < len(cut.force) < len(whole.force)


def test_whole_numbers_that_no_float_holds_are_refused(put) -> None:
    # Doubles whose kind was damaged to 64-bit integers are such numbers.
    columns = zip(NAMES, ([0, 1, 2], [1, 2, 3], [1, 2**53 + 2, 3]), strict=True)
    data = tdms(*((name, np.array(values, np.int64)) for name, values in columns))
    assert "'force_N' holds whole numbers beyond" in refusal(put(data, "log.tdms"))


# MDF


def test_mdf_chain_that_bites_its_tail_and_version_3_are_refused(put) -> None:
    needs("asammdf")
    data = bytearray(binary_logs.mdf(SCENARIO))
    at = data.index(b"##CN")
    data[at + 24 : at + 32] = struct.pack("<Q", at)  # the next channel is the channel itself
    assert "leads to itself" in refusal(put(bytes(data), "a.mf4"))
    assert "3.30" in refusal(put(b"MDF     3.30    TGT 15.0" + bytes(200), "a.mdf"))


# Archives


def archive(**members: bytes | str) -> bytes:
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(name.replace("__", "/"), content)
    return sink.getvalue()


HUGE = {"xl__workbook.xml": "<workbook/>", "xl__sheet1.xml": bytes(11_000_000)}


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (archive(log="time_s,displacement_mm,force_N\n"), "ZIP archive; unpack it"),
        (archive(**{"a.npy": b"", "b.npy": b""}), "NumPy archive without units"),
        (archive(**{"content.xml": b""}), "OpenDocument file; save the sheet as .xlsx"),
        (archive(**HUGE), "limit of 10000000"),
    ],
)
def test_an_archive_that_is_no_workbook_or_too_large_is_refused(put, data, says) -> None:
    assert says in refusal(put(data, "a.xlsx"), max_bytes=10**7)


def test_cells_are_named_with_their_row_and_formulas_are_counted(put) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    pytest.importorskip("python_calamine")
    recording = read_log(put(binary_logs.excel(SCENARIO), "log.xlsx"))
    assert "1 cells hold formulas; their last saved values are read" in recording.notes
    book, sink = openpyxl.Workbook(), io.BytesIO()
    for row in (NAMES, *([row, row, "OVR" if row == 4 else row] for row in range(6))):
        book.active.append(row)
    book.save(sink)
    assert "line 6: force is 'OVR'" in refusal(put(sink.getvalue(), "a.xlsx"))


# Parquet


TABLE = parquet_table(SCENARIO)
TODAY = 1_700_000_000


@pytest.mark.parametrize(
    ("times", "expected", "note"),
    [
        # Whole ticks are subtracted: as floats, stamps of today are 0.2 us coarse.
        (pa.array([TODAY, TODAY + 2], pa.timestamp("s")), [0.0, 2.0], "wall clock"),
        (pa.array([7, 10], pa.timestamp("ms", "Europe/Berlin")), [0.0, 3e-3], "wall clock"),
        (pa.array([7, 10], pa.timestamp("us")), [0.0, 3e-6], "wall clock"),
        (pa.array([TODAY * 10**9 + 1, TODAY * 10**9 + 3], pa.timestamp("ns")), [0.0, 2e-9], "wall"),
        (pa.array([5000, 5002], pa.duration("ms")), [5.0, 5.002], ""),
        (pa.array([86_399_995, 2], pa.time32("ms")), [0.0, 7e-3], "wall clock"),  # over midnight
        (pa.array([7, 10], pa.time64("us")), [0.0, 3e-6], "wall clock"),
        (pa.array([7, 10], pa.time64("ns")), [0.0, 3e-9], "wall clock"),
        (pa.array([1, 2], pa.int16()), [1.0, 2.0], ""),
    ],
)
def test_times_of_parquet(put, times, expected, note) -> None:
    table = TABLE.slice(0, 2).set_column(0, "time_s", times)
    recording = read_log(put(parquet_bytes(table), "log.parquet"))
    np.testing.assert_allclose(recording.time, expected, rtol=1e-12)
    assert any(note in one for one in recording.notes) or not note


GAPS = pa.array([1.0, None, 2.0, None, 3.0])


@pytest.mark.parametrize(
    ("column", "says"),
    [
        ((2, "force_N", pa.array(["a"] * 5)), "force is of type string, expected numbers"),
        ((2, "force_N", GAPS), "row 2: force is blank, NaN or infinite, in 2 of 5"),
        ((0, "time", pa.array([None, 1, 2, 3, 4], pa.timestamp("s"))), "row 1: time is blank"),
    ],
)
def test_parquet_that_is_refused(put, column, says) -> None:
    assert says in refusal(put(parquet_bytes(TABLE.set_column(*column)), "log.parquet"))


def test_parquet_bomb_is_refused_before_it_is_read(put) -> None:
    zeros = pa.array(np.zeros(2_000_000))
    data = parquet_bytes(pa.table([zeros] * 4, names=HEADER.split(",")))
    assert len(data) < 100_000
    says = "a table of 2000000 rows claims 64000000 bytes, more than the limit"
    assert says in refusal(put(data, "log.parquet"), max_bytes=10_000_000)
    assert "no data rows" in refusal(put(parquet_bytes(TABLE.slice(0, 0)), "log.parquet"))


def test_parquet_without_checksums_says_so_and_units_stand_in_fields(put) -> None:
    sink = pa.BufferOutputStream()
    parquet.write_table(TABLE, sink)
    bare = read_log(put(sink.getvalue().to_pybytes(), "log.parquet"))
    assert any("without page checksums" in note for note in bare.notes)
    for version in ("1.0", "2.0"):
        data = parquet_bytes(TABLE, data_page_version=version)
        assert not any("checksums" in note for note in read_log(put(data, "log.parquet")).notes)
    units = {"time": "s", "displacement": "um", "force": "kN"}
    for key in ("unit", "units", "Unit"):
        fields = [pa.field(name, pa.float64(), metadata={key: units[name]}) for name in units]
        columns = [pa.array(values) for values in ([0, 0.1], [1e3, 2e3], [0.1, 0.2])]
        data = parquet_bytes(pa.table(columns, schema=pa.schema(fields)))
        np.testing.assert_allclose(read_log(put(data, "s_3.parquet")).force, [100.0, 200.0])


# Damage: the numbers of the whole file or a refusal, never others in silence.


@cache
def good(name: str) -> tuple[bytes, str]:
    """A good log's bytes and file."""
    if name == "Parquet":
        return parquet_bytes(TABLE), "log.parquet"
    pytest.importorskip("nptdms")
    write = binary_logs.tdms_waveform if name == "TDMS waveform" else binary_logs.tdms
    return write(SCENARIO), "log.tdms"


def attempted(path, data: bytes, options: ReadOptions = ReadOptions()):
    """What is read of the bytes; nothing where they are refused."""
    path.write_bytes(data)
    try:
        return read_logs(path, options)
    except LogError:
        return ()


def changed(whole, found) -> set[tuple[str, int]]:
    """Channel and place of every number that is another; (channel, -1): another length."""
    places = set()
    for channel in CHANNELS:
        expected, values = getattr(whole, channel), getattr(found, channel)
        if len(values) != len(expected):
            places.add((channel, -1))
        else:
            places.update((channel, int(i)) for i in np.flatnonzero(values != expected))
    return places


def flipped(data: bytes, bits) -> bytes:
    damaged = bytearray(data)
    for bit in bits:
        damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


@pytest.mark.parametrize("stride", [97, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["TDMS", "TDMS waveform", "Parquet"])
def test_a_flipped_bit_changes_its_own_value_at_most(tmp_path, name, stride) -> None:
    # Used to give 4 of 5 rows, or displacements of 1e18 mm, when a length or a kind was flipped.
    data, file = good(name)
    path = tmp_path / file
    (whole,) = attempted(path, data)
    n_refused = n_same = n_changed = 0
    for bit in range(0, 8 * len(data), stride):
        found = attempted(path, flipped(data, [bit]))
        if len(found) != 1:  # more: a time that jumps begins another test, and is told
            n_refused += not found
            continue
        if any(one.code == "own_rows" for one in found[0].findings):
            continue  # a start or a rate of one channel, which is told
        places = changed(whole, found[0])
        assert len(places) <= (name != "Parquet"), (bit, places)
        assert ("time", -1) not in places
        n_same, n_changed = n_same + (not places), n_changed + bool(places)
    least = min(n_refused, n_same) if name == "Parquet" else min(n_refused, n_same, n_changed)
    assert least > 500 // stride


@pytest.mark.parametrize("stride", [29, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["TDMS", "TDMS waveform", "Parquet"])
def test_a_cut_never_changes_a_number(tmp_path, name, stride) -> None:
    data, file = good(name)
    path = tmp_path / file
    (whole,) = attempted(path, data)
    between = data.rfind(b"TDSm")  # a file cut between two segments is whole
    for n in range(0, len(data), stride):
        if n != between:
            assert attempted(path, data[:n]) == ()
        for found in attempted(path, data[:n], ReadOptions(allow_truncated=True)):
            for channel in CHANNELS:
                kept = getattr(whole, channel)[: len(found.time)]
                np.testing.assert_array_equal(getattr(found, channel), kept)
