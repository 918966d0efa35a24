"""Binary formats: the arrays that were written, or one line; and limits before memory."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy import io as scipy_io

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_log, read_logs
from tests.io import binary_logs, scenarios
from tests.io.binary_logs import WRITERS, needs
from tests.io.scenarios import Scenario, check_round_trip

SCENARIO = Scenario()
UNITS = {"time": "s", "displacement": "mm", "force": "N"}


def put(tmp_path, data: bytes, name: str):
    path = tmp_path / name
    path.write_bytes(data)
    return path


def refusal(path, options: ReadOptions = ReadOptions()) -> str:
    with pytest.raises(LogError) as caught:
        read_logs(path, options)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(path.name)
    return str(caught.value)


@pytest.mark.parametrize("writer", WRITERS)
def test_every_writer_and_reader_agree(tmp_path, writer) -> None:
    file_name, write, needed = WRITERS[writer]
    needs(*needed)
    check_round_trip(tmp_path, file_name, write(SCENARIO), SCENARIO, ReadOptions())


@pytest.mark.parametrize("writer", WRITERS)
def test_a_cut_file_is_refused(tmp_path, writer) -> None:
    file_name, write, needed = WRITERS[writer]
    needs(*needed)
    data = write(SCENARIO)
    # HDF5 is read in a process of its own, another one after each refusal: 0.6 s.
    for kept in (len(data) // 2, len(data) - 9)[writer == "MATLAB 7.3" :]:
        refusal(put(tmp_path, data[:kept], file_name))


# Format, module that must be absent, name of the extra.
EXTRAS = [
    ("TDMS", "nptdms", "tdms"),
    ("MDF", "asammdf", "mdf"),
    ("MATLAB 7.3", "h5py", "mat73"),
    ("Excel", "python_calamine", "excel"),
]


@pytest.mark.parametrize(("writer", "module", "extra"), EXTRAS)
def test_a_missing_library_is_one_line_with_the_command(
    tmp_path, monkeypatch, writer, module, extra
) -> None:
    file_name, write, needed = WRITERS[writer]
    needs(*needed)
    path = put(tmp_path, write(SCENARIO), file_name)
    monkeypatch.setitem(sys.modules, module, None)
    assert f"pip install 'damperfit[{extra}]'" in refusal(path)


def test_no_format_library_is_imported_for_text(tmp_path) -> None:
    path = put(tmp_path, b"time_s,displacement_mm,force_N\n0,1,2\n1,2,3\n2,3,4\n", "log.csv")
    code = (
        "import sys; from damperfit.io import read_log; read_log(sys.argv[1]);"
        "print([m for m in ('nptdms', 'asammdf', 'h5py', 'python_calamine', 'scipy', 'pandas',"
        " 'zipfile') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, path], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


# MATLAB


def saved(variables: dict, *, is_packed: bool = True) -> bytes:
    sink = io.BytesIO()
    scipy_io.savemat(sink, variables, do_compression=is_packed)
    return sink.getvalue()


def test_columns_of_a_matrix_are_numbered(tmp_path) -> None:
    x_f = np.column_stack([np.linspace(0.0, 9.0, 20), np.zeros(20), np.linspace(5.0, 6.0, 20)])
    data = saved({"Tout": np.arange(20.0)[:, None] / 100.0, "x_F": x_f})
    options = ReadOptions(
        columns={"time": "Tout", "displacement": "x_F:1", "force": "x_F:3"}, units=UNITS
    )
    recording = read_log(put(tmp_path, data, "a.mat"), options)
    np.testing.assert_allclose(recording.displacement, x_f[:, 0] / 1000.0, rtol=1e-15)
    np.testing.assert_array_equal(recording.force, x_f[:, 2])
    np.testing.assert_array_equal(recording.time, np.arange(20.0) / 100.0)


def test_scalars_left_over_by_scripts_are_no_channels(tmp_path) -> None:
    # "f" is a frequency here and would otherwise be taken for the force.
    column = np.arange(20.0)[:, None]
    data = saved({"time_s": column, "position_mm": column, "load_N": column, "f": 1.5, "t": 0.2})
    recording = read_log(put(tmp_path, data, "a.mat"))
    np.testing.assert_array_equal(recording.force, np.arange(20.0))
    assert "2 variables left out; they are not vectors of 20 numbers" in recording.notes


@pytest.mark.parametrize("is_packed", [True, False])
@pytest.mark.parametrize("kind", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"])
def test_every_kind_of_number_is_read_as_scipy_reads_it(tmp_path, kind, is_packed) -> None:
    # MATLAB stores numbers in fewer bytes where they fit; SciPy is the second opinion.
    values = np.arange(60, dtype=kind).reshape(20, 3)
    data = saved({"a": values, "time_s": np.arange(20.0)[:, None]}, is_packed=is_packed)
    options = ReadOptions(columns={"displacement": "a:1", "force": "a:3"}, units=UNITS)
    recording = read_log(put(tmp_path, data, "a.mat"), options)
    expected = scipy_io.loadmat(io.BytesIO(data))["a"]
    np.testing.assert_array_equal(recording.force, expected[:, 2])
    expected_si = expected[:, 0].astype(float) * 1e-3
    np.testing.assert_array_equal(recording.displacement, expected_si)


@pytest.mark.parametrize("is_packed", [True, False])
def test_matlab_without_numbers_says_what_it_holds(tmp_path, is_packed) -> None:
    message = refusal(put(tmp_path, saved({"a": "text"}, is_packed=is_packed), "a.mat"))
    assert "no vectors of numbers" in message
    assert "'a' (char)" in message


def test_matlab_bomb_is_refused_before_it_is_unpacked(tmp_path) -> None:
    n = 1_000_000
    data = saved({"time_s": np.zeros((n, 1)), "x_mm": np.zeros((n, 1)), "f_N": np.zeros((n, 1))})
    assert len(data) < 32 * n / 100
    message = refusal(put(tmp_path, data, "a.mat"), ReadOptions(max_bytes=250_000))
    assert "rig.max_log_bytes" in message


def test_complex_and_object_variables_are_never_channels(tmp_path) -> None:
    column = np.arange(20.0)[:, None]
    data = saved({"time_s": column, "displacement_mm": column, "force_N": column + 1j})
    assert "no column for force" in refusal(put(tmp_path, data, "a.mat"))
    cell = np.full((20, 1), 1.0, dtype=object)
    data = saved({"time_s": column, "displacement_mm": column, "force_N": cell})
    assert "force" in refusal(put(tmp_path, data, "a.mat"))


# TDMS


def test_tdms_channels_of_different_length_are_named(tmp_path) -> None:
    nptdms = pytest.importorskip("nptdms")
    sink = io.BytesIO()
    with nptdms.TdmsWriter(sink) as writer:
        lengths = {"time_s": 10, "displacement_mm": 10, "force_N": 9}
        writer.write_segment(
            [nptdms.ChannelObject("run", name, np.arange(float(n))) for name, n in lengths.items()]
        )
    message = refusal(put(tmp_path, sink.getvalue(), "a.tdms"))
    assert "different length" in message
    assert "force 9" in message


@pytest.mark.parametrize(
    ("step", "offset", "n"), [(0.002, 0.0, 5), (0.001, 0.003, 6), (0.001, 0.006, 0)]
)
def test_tdms_channels_of_different_rate_or_start_are_read_at_the_times_of_the_force(
    tmp_path, step, offset, n
) -> None:
    nptdms = pytest.importorskip("nptdms")
    sink = io.BytesIO()
    with nptdms.TdmsWriter(sink) as writer:
        clocks = {"displacement_mm": (0.001, 0.0), "force_N": (step, offset)}
        writer.write_segment(
            [
                nptdms.ChannelObject(
                    "run", name, np.arange(9.0), {"wf_increment": dt, "wf_start_offset": start}
                )
                for name, (dt, start) in clocks.items()
            ]
        )
    path = put(tmp_path, sink.getvalue(), "a.tdms")
    if not n:  # hardly any of it is there at the same time
        assert "different rate or start" in refusal(path)
        return
    recording = read_log(path)
    np.testing.assert_array_equal(recording.force, np.arange(float(n)))
    np.testing.assert_allclose(1e6 * recording.displacement, 1e6 * recording.time)


def test_each_tdms_group_that_is_a_test_is_a_recording(tmp_path) -> None:
    nptdms = pytest.importorskip("nptdms")
    sink = io.BytesIO()
    with nptdms.TdmsWriter(sink) as writer:
        for setting in (3, 4):
            group = nptdms.GroupObject(f"run {setting}", {"setting": setting})
            channels = [
                nptdms.ChannelObject(
                    f"run {setting}", name, values * setting, {"unit_string": unit}
                )
                for (name, values), unit in zip(
                    binary_logs.arrays(SCENARIO).items(),
                    binary_logs.CHANNELS.values(),
                    strict=True,
                )
            ]
            writer.write_segment([group, *channels])
        writer.write_segment([nptdms.ChannelObject("other", "noise", np.arange(4.0))])
    path = put(tmp_path, sink.getvalue(), "a.tdms")
    recordings = read_logs(path)
    assert [recording.setting for recording in recordings] == [3, 4]
    for recording in recordings:
        expected = np.array(SCENARIO.force_n) * recording.setting.cell
        np.testing.assert_array_equal(recording.force, expected)
    with pytest.raises(LogError, match="2 tests"):
        read_log(path)


def test_tdms_that_claims_more_than_it_holds_is_refused(tmp_path) -> None:
    pytest.importorskip("nptdms")
    data = binary_logs.tdms(SCENARIO)
    n = len(SCENARIO.time)
    # Type double, dimension 1, n values: the first channel's raw data index.
    index = struct.pack("<IIQ", 10, 1, n)
    assert data.count(index) == 4
    for claimed in (n + 1, n - 1, 10**12, 2**63):
        damaged = data.replace(index, struct.pack("<IIQ", 10, 1, claimed), 1)
        refusal(put(tmp_path, damaged, "a.tdms"))


def test_tdms_cut_anywhere_is_refused(tmp_path) -> None:
    # npTDMS reads 991 of 1000 values, and nothing of the next channel, without an error.
    pytest.importorskip("nptdms")
    data = binary_logs.tdms_waveform(SCENARIO)
    at_segment = data.index(b"TDSm", 4)
    for kept in set(range(5, len(data), 7)) - {at_segment}:
        refusal(put(tmp_path, data[:kept], "a.tdms"))


def test_a_cut_tdms_that_is_kept_says_so_and_a_whole_one_does_not(tmp_path) -> None:
    pytest.importorskip("nptdms")
    data = binary_logs.tdms(SCENARIO)
    options = ReadOptions(allow_truncated=True)
    whole = read_log(put(tmp_path, data, "a.tdms"), options)
    assert not [one for one in whole.findings if one.name == "truncated"]
    cut = read_log(put(tmp_path, data[:-16], "b.tdms"), options)
    (found,) = [one for one in cut.findings if one.name == "truncated"]
    assert found.severity == "warning"
    assert found.sentence.startswith("the end of the file is missing: ")
    assert len(cut.force) < len(whole.force)


# MDF


def test_mdf_chain_that_bites_its_tail_is_refused(tmp_path) -> None:
    needs("asammdf")
    data = bytearray(binary_logs.mdf(SCENARIO))
    at = data.index(b"##CN")
    data[at + 24 : at + 32] = struct.pack("<Q", at)  # the next channel is the channel itself
    assert "leads to itself" in refusal(put(tmp_path, bytes(data), "a.mf4"))


def test_mdf_of_version_3_is_refused(tmp_path) -> None:
    data = b"MDF     3.30    TGT 15.0" + bytes(200)
    assert "3.30" in refusal(put(tmp_path, data, "a.mdf"))


# Libraries that may end the process: see also test_child_process.py


def test_modules_beside_a_log_are_never_imported(tmp_path, monkeypatch) -> None:
    pytest.importorskip("h5py")
    (tmp_path / "h5py.py").write_text("raise SystemExit(7)")
    (tmp_path / "json.py").write_text("raise SystemExit(7)")
    monkeypatch.chdir(tmp_path)
    path = put(tmp_path, binary_logs.matlab_73(SCENARIO), "a.mat")
    np.testing.assert_array_equal(read_log(path).force, SCENARIO.force_n)


def test_hdf5_that_claims_terabytes_is_refused(tmp_path) -> None:
    h5py = pytest.importorskip("h5py")
    sink = io.BytesIO()
    with h5py.File(sink, "w") as file:
        for name in ("time_s", "displacement_mm", "force_N"):
            # Nothing is stored until something is written.
            file.create_dataset(name, shape=(1, 10**12), dtype="f8", chunks=(1, 1000))
    assert "rig.max_log_bytes" in refusal(put(tmp_path, sink.getvalue(), "a.mat"))


# Excel


def test_excel_counts_formulas_and_takes_their_saved_values(tmp_path) -> None:
    pytest.importorskip("openpyxl")
    pytest.importorskip("python_calamine")
    recording = read_log(put(tmp_path, binary_logs.excel(SCENARIO), "log.xlsx"))
    assert "1 cells hold formulas; their last saved values are read" in recording.notes


def test_text_in_a_cell_is_named_with_its_row(tmp_path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    pytest.importorskip("python_calamine")
    book = openpyxl.Workbook()
    book.active.append(["time_s", "displacement_mm", "force_N"])
    for row in range(6):
        book.active.append([row, row, "OVR" if row == 4 else row])
    sink = io.BytesIO()
    book.save(sink)
    message = refusal(put(tmp_path, sink.getvalue(), "a.xlsx"))
    assert "line 6: force is 'OVR'" in message


def test_archive_that_is_no_workbook_is_refused(tmp_path) -> None:
    import zipfile

    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w") as archive:
        archive.writestr("../../log.csv", "time_s,displacement_mm,force_N\n")
    assert "ZIP archive; unpack it" in refusal(put(tmp_path, sink.getvalue(), "a.zip"))


def test_excel_bomb_is_refused(tmp_path) -> None:
    import zipfile

    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
        archive.writestr("xl/worksheets/sheet1.xml", bytes(30_000_000))
    path = put(tmp_path, sink.getvalue(), "a.xlsx")
    assert path.stat().st_size < 100_000
    assert "limit of 10000000" in refusal(path, ReadOptions(max_bytes=10_000_000))


# Any damage


@pytest.mark.parametrize("writer", sorted(set(WRITERS) - {"Excel called CSV"}))
def test_damaged_bytes_give_a_log_or_one_line(tmp_path, writer) -> None:
    file_name, write, needed = WRITERS[writer]
    needs(*needed)
    data = write(SCENARIO)
    path = tmp_path / file_name
    # MDF and HDF5 are read in a process of their own, 0.2 s each.
    n_examples = {"MDF": 4, "MATLAB 7.3": 4, "Excel": 12}.get(writer, 25)

    @settings(
        max_examples=n_examples,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        derandomize=True,
        database=None,
    )
    @given(
        st.lists(
            st.tuples(st.integers(0, len(data) - 1), st.integers(0, 255)), min_size=1, max_size=8
        )
    )
    def attempt(changes) -> None:
        damaged = bytearray(data)
        for at, byte in changes:
            damaged[at] = byte
        path.write_bytes(bytes(damaged))
        with suppress(LogError):
            for recording in read_logs(path):
                assert np.isfinite(recording.force).all()

    attempt()


# Parquet


@pytest.mark.parametrize("stride", [pytest.param(23), pytest.param(1, marks=pytest.mark.slow)])
def test_a_flipped_bit_in_parquet_never_changes_a_number(tmp_path, stride) -> None:
    # The pages have checksums; the footer, with its counts, has none.
    file_name, write = scenarios.WRITERS["Parquet"]
    data = write(SCENARIO)
    path = put(tmp_path, data, file_name)
    good = read_log(path)
    n_refused = 0
    for position in range(0, 8 * len(data), stride):
        flipped = bytearray(data)
        flipped[position // 8] ^= 1 << position % 8
        path.write_bytes(bytes(flipped))
        try:
            found = read_log(path)
        except LogError:
            n_refused += 1
            continue
        for channel in ("time", "displacement", "force"):
            expected = getattr(good, channel)
            np.testing.assert_array_equal(getattr(found, channel), expected, err_msg=f"{position}")
    assert n_refused > 4 * len(data) // stride


@pytest.mark.parametrize("key", ["unit", "units", "Unit"])
def test_units_of_parquet_fields_by_any_usual_key(tmp_path, key) -> None:
    # Only "unit" used to be looked at.
    import pyarrow as pa
    from pyarrow import parquet

    units = {"time": "s", "displacement": "um", "force": "kN"}
    fields = [pa.field(name, pa.float64(), metadata={key: units[name]}) for name in units]
    columns = [pa.array(values) for values in ([0, 0.1, 0.2], [1e3, 2e3, 3e3], [0.1, 0.2, 0.3])]
    path = tmp_path / "setting_3.parquet"
    parquet.write_table(pa.table(columns, schema=pa.schema(fields)), path)
    np.testing.assert_allclose(read_log(path).force, [100.0, 200.0, 300.0])


def test_a_matlab_structure_says_how_to_save_it(tmp_path) -> None:
    path = tmp_path / "setting_3.mat"
    scipy_io.savemat(path, {"run": {"time_s": np.arange(5.0)}})
    with pytest.raises(LogError, match=r"'run' \(struct\); save its fields.*'-struct', 'run'"):
        read_log(path)
