"""Logs as rigs write them: each dialect in a few lines, with the arrays it must give."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.errors import ConfigurationError, LogError
from damperfit.io import Profile, ReadOptions, read_log, read_logs
from damperfit.io import text as rows
from tests.io.scenarios import Scenario, text


@pytest.fixture
def put(tmp_path):
    def write(content: str | bytes, name: str = "log.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def profile_of(name: str, keys: dict) -> Profile:
    """The profile that [rig.profiles.NAME] of a configuration describes."""
    (profile,) = load_configuration(overlay={"rig": {"profiles": {name: keys}}}).reading.profiles
    return profile


# --- stand-alone logger ------------------------------------------------------------------------

LOGGER = """Header Size:  7\r
Version:  2\r
Sampling Interval:  0.005\r
Sampling Rate:  200\r
Sample Count:  9\r
Device Serial Number:  0\r
Sample Number, Date/Time, CHANNEL0, CHANNEL1, Events\r
         1,   04/29/2022 11:59:56.995 AM, 0.0320, -2.9931, DAQ Start\r
         2,   04/29/2022 11:59:57.000 AM, 0.0310, -2.9934\r
         3,   04/29/2022 11:59:57.005 AM, 0.0300, -2.9934\r
         4,   04/29/2022 11:59:57.010 AM, 0.0290, -2.9934, DAQ Pause\r
         5,   04/29/2022 12:00:11.500 PM, 0.0280, -2.9934, DAQ Resume\r
         6,   04/29/2022 12:00:11.505 PM, 0.0270, -2.9931\r
         7,   04/29/2022 12:00:11.510 PM, 0.0260, -2.9934, DAQ Pause\r
         8,   04/29/2022 12:01:05.510 PM, 0.0250, -2.9934, DAQ Resume\r
         9,   04/29/2022 12:01:05.515 PM, 0.0240, -2.9931, DAQ Pause\r
"""
LOGGER_PROFILE = profile_of(
    "logger",
    {
        "files": "ME*.txt",
        "columns": {"displacement": "CHANNEL1", "force": "CHANNEL0"},
        "units": {"displacement": "mm", "force": "N"},
        "scales": {"displacement": 10, "force": 980.665},
        "offsets": {"displacement": 30.0},
        "part_settings": [0, 25, 50],
    },
)


def test_the_tests_of_a_file_have_labels_too(put) -> None:
    path = put(LOGGER, "ME2mm.txt")

    def read(*labels: str) -> list[str]:
        declared = {**LOGGER_PROFILE.declared, "part_settings": labels}
        profile = Profile(name="logger", files="ME*.txt", declared=declared)
        options = ReadOptions(profiles=(profile,), adjusters=("rebound", "compression"))
        return [str(part.setting) for part in read_logs(path, options)]

    assert read("R12 C8", "12r/6c", "R-1 C2.5") == ["R12 C8", "R12 C6", "R-1 C2.5"]
    with pytest.raises(LogError, match="part_settings: setting '12'; expected a place for each"):
        read("R1 C1", "12", "R1 C2")


def test_logger_in_volts_with_pauses_and_events(put) -> None:
    path = put(LOGGER, "ME2mm.txt")
    parts = read_logs(path, ReadOptions(profiles=(LOGGER_PROFILE,)))
    assert [part.name for part in parts] == [f"ME2mm.txt part {i}" for i in (1, 2, 3)]
    assert [part.setting for part in parts] == [0, 25, 50]
    assert [len(part.time) for part in parts] == [4, 3, 2]
    # Over noon on a 12-hour clock.
    np.testing.assert_allclose(parts[1].time, [14.505, 14.510, 14.515], rtol=1e-14)
    np.testing.assert_allclose(
        parts[0].force, np.array([0.032, 0.031, 0.030, 0.029]) * 980.665, rtol=1e-14
    )
    np.testing.assert_allclose(parts[2].displacement, [0.066e-3, 0.069e-3], rtol=1e-12)
    assert parts[0].notes[:2] == ("profile: logger", "3 tests in this file")
    assert "force: 980.665 times the log plus 0, as declared" in parts[0].notes
    assert parts[0].metadata["sampling rate"] == "200"


def test_a_declared_rate_replaces_the_clock_but_pauses_still_count(put) -> None:
    options = ReadOptions(profiles=(LOGGER_PROFILE,), sample_rate=200.0)
    parts = read_logs(put(LOGGER, "ME2mm.txt"), options)
    assert [len(part.time) for part in parts] == [4, 3, 2]
    np.testing.assert_array_equal(parts[1].time, [0.0, 0.005, 0.01])


@pytest.mark.parametrize(("unit", "n_infinite"), [("N", 3), ("kN", 4)])  # 1.5e308 N is a number
def test_a_scale_that_overflows_is_refused(put, unit, n_infinite) -> None:
    options = ReadOptions(scales={"force": 1e308}, units={"force": unit})
    with pytest.raises(LogError, match=f"line 2: force is .*infinite, in {n_infinite} of 5"):
        read_log(put(text(Scenario())), options)


def test_logger_without_profile_says_what_is_missing(put) -> None:
    with pytest.raises(
        LogError, match="no column for displacement and force; there are 'Sample Number'"
    ):
        read_logs(put(LOGGER, "other.txt"), ReadOptions(profiles=(LOGGER_PROFILE,)))
    named = ReadOptions(profiles=(LOGGER_PROFILE,), profile="logger")
    assert len(read_logs(put(LOGGER, "other.txt"), named)) == 3


def test_settings_must_be_as_many_as_tests(put) -> None:
    options = ReadOptions(profiles=(LOGGER_PROFILE,), profile="logger", pause=60.0)
    with pytest.raises(LogError, match=r"1 tests found, but 3 settings declared"):
        read_logs(put(LOGGER, "ME1.txt"), options)


def test_a_row_with_two_extra_fields_is_no_event(put) -> None:
    path = put(LOGGER.replace("DAQ Pause\r", "DAQ, Pause\r", 1), "ME1.txt")
    with pytest.raises(LogError, match="line 11: found 6 fields, expected 5 fields as in line 7"):
        read_logs(path, ReadOptions(profiles=(LOGGER_PROFILE,)))


# --- MTS ---------------------------------------------------------------------------------------


def _mts(decimal: str) -> str:
    head = f"MTS793|MPT|ENU|1|2|{decimal}|/|:|1|0|0|A\r\n\r\n"
    blocks = []
    for start, stamp in ((10.0, "1:54:32"), (20.0, "1:54:52")):
        rows = "".join(
            f"{start + i / 100:.2f}\t{i + start}\t{-0.5 * i}\t0.3\r\n".replace(".", decimal)
            for i in range(4)
        )
        blocks.append(
            f"Data Acquisition: Timed\t\tTime:\t{start}\tSec\t3/29/2016 {stamp} PM\r\n"
            "Running Time\tAxial Displacement\tAxial Force\tCurrent FB_1\r\n"
            f"Sec\tmm\tkN\tA\r\n{rows}\r\n"
        )
    return head + "".join(blocks)


@pytest.mark.parametrize("decimal", [".", ","])
def test_mts_blocks_are_tests(put, decimal) -> None:
    parts = read_logs(put(_mts(decimal), "specimen.dat"))
    assert len(parts) == 2
    for part, start in zip(parts, (10.0, 20.0), strict=True):
        np.testing.assert_allclose(part.time, start + np.arange(4) / 100, rtol=1e-14)
        np.testing.assert_allclose(part.displacement, (np.arange(4) + start) / 1e3, rtol=1e-14)
        np.testing.assert_array_equal(part.force, -500.0 * np.arange(4))
    assert parts[1].notes[1].startswith("part: Data Acquisition: Timed")


def test_what_stands_above_the_blocks_holds_for_all(put) -> None:
    log = _mts(".").replace("\r\n\r\n", "\r\nSetting: 7\r\nOperator: A\r\n", 1)
    parts = read_logs(put(log, "specimen.dat"))
    assert [(part.setting, part.metadata["operator"]) for part in parts] == [(7, "A")] * 2


def test_mts_decimal_mark_of_the_first_line_counts(put) -> None:
    # Whole numbers but one: the rows alone would not tell that the comma is the decimal mark.
    log = _mts(",").replace("\t-0,5\t", "\t1.500\t")
    with pytest.raises(LogError, match=r"line 7: force is '1\.500', expected a number"):
        read_logs(put(log, "specimen.dat"))


def test_a_fault_in_the_second_mts_block_has_its_line_in_the_file(put) -> None:
    log = _mts(".").replace("20.01\t", "OVR\t")
    with pytest.raises(LogError, match="line 15: time is 'OVR', expected a number"):
        read_logs(put(log, "specimen.dat"))


def test_an_mts_block_without_rows(put) -> None:
    with pytest.raises(LogError, match="no data rows after 'Data Acquisition' in line 1"):
        read_logs(put("Data Acquisition: Timed\n", "specimen.dat"))


# --- Instron and other text --------------------------------------------------------------------


def test_instron_export(put) -> None:
    log = (
        "General : Start date,2021-05-04\n"
        'Specimen : Diameter,"12.5",mm\n'
        'Specimen : Rate 1,"30.0",mm/min\n'
        "\n"
        "Time,Extension,Load\n"
        "(s),(mm),(kgf)\n"
        '"0.000","1.5","-2.0"\n'
        '"0.010","1.6","-3.0"\n'
        '"0.020","1.7","-4.0"\n'
    )
    recording = read_log(put(log, "s4.csv"))
    np.testing.assert_array_equal(recording.time, [0.0, 0.01, 0.02])
    np.testing.assert_allclose(recording.displacement, [1.5e-3, 1.6e-3, 1.7e-3], rtol=1e-15)
    np.testing.assert_allclose(recording.force, np.array([-2.0, -3.0, -4.0]) * 9.80665)
    assert recording.setting == 4
    assert "displacement: column 'Extension'" in recording.notes


def test_student_log_with_iso_stamps_volts_and_a_velocity(put) -> None:
    log = (
        "Timestamp,RPM,Force (V),Force (N),Displacement (V),Displacement (mm),Velocity (m/s),"
        "Temperature (V),Temperature (C)\n"
        "2023-03-01T23:59:59.998000+01:00,90,0.1,1.0,0.2,12.7,9,0.3,26.1\n"
        "2023-03-02T00:00:00.001000+01:00,90,0.1,2.0,0.2,12.8,9,0.3,26.2\n"
        "2023-03-02T00:00:00.004000+01:00,90,0.1,3.0,0.2,12.9,9,0.3,26.3\n"
    )
    recording = read_log(put(log))
    np.testing.assert_allclose(recording.time, [0.0, 0.003, 0.006], rtol=1e-12)
    np.testing.assert_array_equal(recording.force, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(recording.displacement, [0.0127, 0.0128, 0.0129], rtol=1e-15)
    assert recording.temperature is not None
    assert "time: wall clock in column 'Timestamp'" in recording.notes


@pytest.mark.parametrize(
    ("stamps", "expected"),
    [
        (("23:59:59", "00:00:00", "00:00:01"), [0, 1, 2]),
        (("12:59:59.5 PM", "1:00:00.0 PM", "1:00:00.5 pm"), [0, 0.5, 1]),
        (("11:59:59 PM", "12:00:00 AM", "12:00:01 a.m."), [0, 1, 2]),
        (("31.12.2023 23:59:59,250", "31.12.2023 23:59:59,750", "01.01.2024 00:00:00,250"), None),
    ],
)
def test_clocks(put, stamps, expected) -> None:
    rows = "".join(f"{stamp};{i};{i}\n" for i, stamp in enumerate(stamps))
    recording = read_log(put("time;displacement_mm;force_N\n" + rows))
    np.testing.assert_allclose(recording.time, expected or [0.0, 0.5, 1.0], atol=1e-12)


def test_a_bad_stamp_has_its_line(put) -> None:
    log = "time,displacement_mm,force_N\n10:00:00,1,2\n10:00:01,1,2\nnoon,1,2\n10:00:03,1,2\n"
    with pytest.raises(LogError, match="line 4: time is 'noon', expected a time of day"):
        read_log(put(log))


def test_clocks_of_which_every_row_is_bad(put) -> None:
    # Used to end in an IndexError.
    log = "time,displacement_mm,force_N\n" + "10:00:00,1,OVR\n" * 4
    with pytest.raises(LogError, match="no data rows; first:"):
        read_log(put(log), ReadOptions(bad_rows="drop"))


def test_sampling_rate_of_the_preamble_stands_in_for_time(put) -> None:
    log = "Sampling Rate: 500 Hz\nsample;displacement_mm;force_N\n" + "".join(
        f"{i};{i};{2 * i}\n" for i in range(4)
    )
    recording = read_log(put(log))
    np.testing.assert_allclose(recording.time, [0.0, 0.002, 0.004, 0.006], rtol=1e-15)
    assert "time: 500 Hz, from the preamble" in recording.notes


# --- Arduino rigs ------------------------------------------------------------------------------

ARDUINO = profile_of(
    "arduino",
    {
        "columns": {"time": 1, "force": 2, "displacement": 3},
        "units": {"time": "ms", "force": "gf", "displacement": "cm"},
        "restarts": "last",
        "bad_rows": "drop",
    },
)


def test_arduino_without_names_with_a_stale_buffer_and_damage(put) -> None:
    rows = [
        b"90500 1000 9.0",  # from the test before
        b"90510 1000 9.0",
        b"0 1000 1.0",
        b"10 2000 1.5\r",
        b"20 \x00000 2.0",
        b"30 START 2.0",
        b"40 nan 2.0",
        b"50 4000",
        b"60 5000 2.5",
    ]
    path = put(b"\n".join(rows) + b"\n", "a.txt")
    recording = read_log(path, ReadOptions(profiles=(ARDUINO,), profile="arduino"))
    np.testing.assert_allclose(recording.time, [0.0, 0.01, 0.06], rtol=1e-15)
    np.testing.assert_allclose(recording.displacement, [0.01, 0.015, 0.025], rtol=1e-15)
    np.testing.assert_allclose(recording.force, [9.80665, 19.6133, 49.03325], rtol=1e-14)
    assert any(note.startswith("4 rows that cannot be read dropped; a.txt, line 5")
               for note in recording.notes)  # fmt: skip


def test_restarts_are_refused_split_or_cut(put) -> None:
    rows = "".join(f"{t},{i},{i}\n" for i, t in enumerate((5, 6, 0, 1, 2)))
    path = put("time_s,displacement_mm,force_N\n" + rows)
    with pytest.raises(LogError, match="line 4: time runs backwards: 0 s after 6 s"):
        read_logs(path)
    split = read_logs(path, ReadOptions(restarts="split"))
    assert [part.time.tolist() for part in split] == [[5.0, 6.0], [0.0, 1.0, 2.0]]
    last = read_logs(path, ReadOptions(restarts="last"))
    assert [part.time.tolist() for part in last] == [[0.0, 1.0, 2.0]]


@pytest.mark.parametrize("end", ["\n", "\r", "\r\n"])
def test_one_bad_row_in_a_large_log(put, monkeypatch, end) -> None:
    # Large enough for several pieces; only the one with the fault is read field by field.
    monkeypatch.setattr(rows, "_PIECE", 50_000)
    n = 7_000
    lines = [f"{i / 1000:.3f},{i % 97},{i % 89},26.0" for i in range(n)]
    lines[6_000] = "6.000,OVR,1,26.0"
    lines.insert(500, "")
    path = put(end.join(["time_s,displacement_mm,force_N,temperature_degC", *lines]) + end)
    assert path.stat().st_size > 2 * rows._PIECE
    with pytest.raises(LogError, match="line 6003: displacement is 'OVR'"):
        read_log(path)
    recording = read_log(path, ReadOptions(bad_rows="drop"))
    kept = np.delete(np.arange(n), 6_000)
    np.testing.assert_array_equal(recording.time, np.round(kept / 1000, 3))
    np.testing.assert_array_equal(recording.force, kept % 89)
    assert any(note.startswith("1 row that") for note in recording.notes)
    lines[4_000] = "nan,1,1,26.0"
    lines[6_500] = "1.0,1,1,26.0"
    path = put(end.join(["time_s,displacement_mm,force_N,temperature_degC", *lines]) + end)
    with pytest.raises(LogError, match="line 6502: time runs backwards"):
        read_log(path, ReadOptions(bad_rows="drop"))


def test_dropped_rows_leave_nothing(put) -> None:
    log = "time_s,displacement_mm,force_N\n" + "0,1,OVR\n" * 5
    with pytest.raises(LogError, match=r"no data rows; first: .*line 2: force is 'OVR'"):
        read_log(put(log), ReadOptions(bad_rows="drop"))


# --- several tests in one file -----------------------------------------------------------------


def test_a_setting_column_makes_tests(put) -> None:
    log = "setting,time_s,displacement_mm,force_N\n" + "".join(
        f"{s},{t},{t},{t}\n" for s in (3, 1) for t in range(3)
    )
    parts = read_logs(put(log))
    assert [(part.setting, part.time.tolist()) for part in parts] == [
        (3, [0.0, 1.0, 2.0]),
        (1, [0.0, 1.0, 2.0]),
    ]


def test_a_short_gap_is_no_pause(put) -> None:
    times = [0.0, 0.01, 0.02, 1.9, 1.91]
    rows = "".join(f"{t},1,2\n" for t in times)
    path = put("time_s,displacement_mm,force_N\n" + rows)
    assert len(read_logs(path)) == 1
    assert len(read_logs(path, ReadOptions(pause=1.0))) == 2


def test_a_slow_log_has_no_pauses(put) -> None:
    rows = "".join(f"{10 * i},1,2\n" for i in range(5))
    assert len(read_logs(put("time_s,displacement_mm,force_N\n" + rows))) == 1


def test_a_broken_clock_is_not_a_thousand_tests(put) -> None:
    times = np.cumsum(np.where(np.arange(60_000) % 52 == 0, 5.0, 0.001))
    rows = "".join(f"{t:.3f},1,2\n" for t in times)
    with pytest.raises(LogError, match=r"time jumps 1153 times.*declare rig.sample_rate"):
        read_logs(put("time_s,displacement_mm,force_N\n" + rows))


# --- preamble, names, units --------------------------------------------------------------------


def test_skipped_lines_are_counted(put) -> None:
    plain = text(Scenario())
    path = put("1,2,3\n4,5,6\n7,8,9\n10,11,12\n" + plain.replace("0.004,0.0", "0.004,OVR"))
    with pytest.raises(LogError, match="line 8: displacement is 'OVR'"):
        read_log(path, ReadOptions(skip_lines=4))
    with pytest.raises(LogError, match="fewer lines than the 99 to skip"):
        read_log(path, ReadOptions(skip_lines=99))


def test_a_long_preamble_of_numbers_and_prose(put) -> None:
    preamble = "".join(f"Note {i}; made on 1; 2; of 3\n" for i in range(60))
    recording = read_log(put(preamble + text(Scenario()).replace(",", ";")))
    np.testing.assert_array_equal(recording.force, Scenario().force_n)
    assert "preamble: 60 lines above the names" in recording.notes
    one = read_log(put("Shock dyno\n" + text(Scenario())))
    assert "preamble: 1 line above the names" in one.notes


def test_a_decimal_comma_below_many_whole_numbers(put) -> None:
    rows = [f"{i};0;0" for i in range(2000)] + ["2000;0,5;-1,25"]
    recording = read_log(put("time_s;displacement_mm;force_N\n" + "\n".join(rows) + "\n"))
    assert (recording.displacement[-1], recording.force[-1]) == (0.0005, -1.25)
    assert "decimal mark: comma" in recording.notes


def test_units_row_of_another_length(put) -> None:
    log = "time;displacement;force\ns;mm\n0;1;2\n1;2;3\n2;3;4\n"
    with pytest.raises(LogError, match="line 2: 2 units for 3 names in line 1"):
        read_log(put(log))


def test_first_rows_with_text_belong_to_the_data(put) -> None:
    log = "time_s,displacement_mm,force_N\n0,OVR,OVR\n1,2,3\n2,3,4\n3,4,5\n"
    with pytest.raises(LogError, match="line 2: displacement is 'OVR'"):
        read_log(put(log))


def test_declared_marks(put) -> None:
    log = 'time_s,displacement_mm,force_N\n"0,5","1.000,5","-12.345.678"\n"1,5","2,5","3"\n'
    path = put(log)
    with pytest.raises(LogError, match=r"line 2: displacement is '1\.000,5'.* rig\.thousands"):
        read_log(path)
    recording = read_log(path, ReadOptions(decimal=",", thousands="."))
    np.testing.assert_array_equal(recording.time, [0.5, 1.5])
    np.testing.assert_array_equal(recording.displacement, [1.0005, 0.0025])
    np.testing.assert_array_equal(recording.force, [-12345678.0, 3.0])


@pytest.mark.parametrize("wrong", ["1,2345", "12,34", "1,234,", ",123", "1234,567"])
def test_groups_of_thousands_are_of_three(put, wrong) -> None:
    log = f'time_s;displacement_mm;force_N\n0;1,234;2\n1;2.5;3\n2;"{wrong}";3\n'
    with pytest.raises(LogError, match="line 4: displacement is"):
        read_log(put(log), ReadOptions(thousands=","))


def test_declared_separator_and_encoding(put) -> None:
    log = "time_s|x_\u00b5m|force_N|1;2\n0|10|20|1;2\n1|20|30|1;2\n"
    options = ReadOptions(encoding="utf-16-le", separator="|")
    recording = read_log(put(log.encode("utf-16-le")), options)
    np.testing.assert_allclose(recording.displacement, [10e-6, 20e-6], rtol=1e-15)
    assert "encoding: utf-16-le, as declared" in recording.notes
    with pytest.raises(LogError, match="is not valid ASCII"):
        read_log(put("time_s,\xe9\n"), ReadOptions(encoding="ascii"))


# --- gzip --------------------------------------------------------------------------------------


def test_gzip_of_text(put) -> None:
    scenario = Scenario()
    packed = gzip.compress(text(scenario).encode())
    recording = read_log(put(packed, "setting_3.csv.gz"))
    np.testing.assert_array_equal(recording.force, scenario.force_n)
    assert recording.setting == 3
    assert "gzip: unpacked" in recording.notes
    half = len(text(scenario)) // 2
    members = gzip.compress(text(scenario)[:half].encode()) + gzip.compress(
        text(scenario)[half:].encode()
    )
    np.testing.assert_array_equal(read_log(put(members, "a.gz")).force, scenario.force_n)


def test_gzip_bomb_stops_at_the_limit(put) -> None:
    # F24: 0.1 MB that unpack to 100 MB.
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    bomb = b"".join(packer.compress(b"0,1,2\n" * 100_000) for _ in range(170)) + packer.flush()
    assert len(bomb) < 300_000
    with pytest.raises(LogError, match="more than the limit of 10000000 bytes when unpacked"):
        read_log(put(bomb, "log.csv.gz"), ReadOptions(max_bytes=10_000_000))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda packed: packed[:-9], "truncated gzip"),
        (lambda packed: packed[:5], "truncated gzip"),
        (lambda packed: packed[:40] + b"\xff\xff" + packed[42:], "damaged gzip"),
        (lambda packed: packed[:-6] + b"\0" + packed[-5:], "damaged gzip"),
        (lambda packed: packed + b"more", "damaged gzip: odd bytes at its end"),
        (gzip.compress, "a gzip inside a gzip"),
        (lambda _: gzip.compress(b""), "empty file inside the gzip"),
    ],
)
def test_damaged_gzip(put, damage, message) -> None:
    packed = gzip.compress(text(Scenario()).encode())
    with pytest.raises(LogError, match=message):
        read_log(put(damage(packed), "log.csv.gz"))


# --- profiles ----------------------------------------------------------------------------------


def test_a_profile_goes_before_the_general_declarations(put) -> None:
    profile = profile_of("a", {"files": "*.csv", "units": {"force": "kN"}})
    options = ReadOptions(units={"force": "N", "displacement": "cm"}, profiles=(profile,))
    log = "time_s,displacement,force\n0,1,2\n1,2,3\n"
    recording = read_log(put(log), options)
    np.testing.assert_array_equal(recording.force, [2000.0, 3000.0])
    np.testing.assert_array_equal(recording.displacement, [0.01, 0.02])


def test_the_first_profile_that_fits_is_taken(put) -> None:
    profiles = tuple(
        profile_of(name, {"files": files, "reverse_force": is_reversed})
        for name, files, is_reversed in (("a", "x*", True), ("b", "l*", True), ("c", "*", False))
    )
    recording = read_log(put(text(Scenario())), ReadOptions(profiles=profiles))
    assert recording.notes[0] == "profile: b"
    np.testing.assert_array_equal(recording.force, -np.array(Scenario().force_n))


def test_quantities_of_a_profile_may_carry_units() -> None:
    profile = profile_of("a", {"sample_rate": "1kHz", "pause": "500ms", "skip_lines": 2})
    assert profile.declared == {"sample_rate": 1000.0, "pause": 0.5, "skip_lines": 2}
    assert profile_of("a", {"sample_rate": 200}).declared == {"sample_rate": 200.0}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"sample_rate": "1s"}, "no unit of frequency 's'"),
        ({"unit": {}}, "rig.profiles.a: unknown key 'unit'.*Did you mean 'units'"),
        ({"units": {"force": "mm"}}, "rig.profiles.a: rig.units: no unit of force 'mm'"),
        ({"units": "N"}, "rig.profiles.a.units: expected a section of keys, found 'N'"),
        ({"scales": {"force": True}}, "scales.force: expected a number, found True"),
        ({"scales": {"force": 0.0}}, "scales: force is 0.0, expected other than 0"),
        ({"offsets": {"force": float("nan")}}, "offsets: force is nan"),
        ({"columns": {"force": 1.5}}, "columns.force: expected a text, found 1.5"),
        ({"part_settings": [True]}, "part_settings.0: expected a whole number, found True"),
        ({"skip_lines": "3"}, "rig.profiles.a.skip_lines: expected a whole number, found '3'"),
        ({"reverse_force": 1}, "expected true, false or 'detect', found 1"),
        ({"sample_rate": -1.0}, "sample_rate: expected 0 or more, found -1.0"),
        (
            {"restarts": "lst"},
            "found 'lst', expected 'refuse' or 'split' or 'last'.*Did you mean 'last'",
        ),
        ({"encoding": "rot13"}, "'rot13' is not a text encoding"),
        ({"separator": "colon"}, "found 'colon', expected ',' or ';'"),
        ({"decimal": "·"}, "decimal: found '·', expected '.' or ','"),
        ({"thousands": ",", "decimal": ","}, "',' already has another meaning"),
        ({"bad_rows": "keep"}, "found 'keep', expected 'refuse' or 'drop'"),
    ],
)
def test_profiles_that_mean_nothing(values, message) -> None:
    with pytest.raises(ConfigurationError, match=message):
        profile_of("a", values)


def test_an_unknown_profile() -> None:
    with pytest.raises(ConfigurationError, match=r"no profile 'loger'.*Did you mean 'logger'"):
        ReadOptions(profile="loger", profiles=(LOGGER_PROFILE,))


# Decimal commas between commas


def _quoted(*rows: str) -> str:
    lines = (",".join(f'"{field}"' for field in row.split()) for row in rows)
    return "\n".join(["time_s,displacement_mm,force_N", *lines]) + "\n"


def test_commas_that_cannot_part_thousands_are_decimal(put) -> None:
    recording = read_log(put(_quoted("0,000 1,250 -1,500", "0,002 1,375 12,625", "0,004 2 3")))
    assert "decimal mark: comma" in recording.notes
    np.testing.assert_array_equal(recording.time, [0.0, 0.002, 0.004])
    np.testing.assert_allclose(recording.displacement, [0.00125, 0.001375, 0.002], rtol=1e-15)
    np.testing.assert_array_equal(recording.force, [-1.5, 12.625, 3.0])


@pytest.mark.parametrize(
    "rows",
    [
        ("0 1,250 -1,500", "1 1,375 12,625", "2 2,000 3,000"),  # all may be thousands
        ("0.5 1,250 -1,5", "1.5 1,375 12,625", "2.5 2,000 3,000"),  # points are there too
        ("0 1,250 1,500", *(f"{i} 1,375 12,625" for i in range(1, 20)), "20 1,5 1,250"),  # one odd
    ],
)
def test_commas_that_may_part_thousands_are_asked_for(put, rows) -> None:
    with pytest.raises(LogError, match=r"line 2: displacement is '1,250'.*rig\.thousands.*decimal"):
        read_log(put(_quoted(*rows)))


def test_times_of_day_need_no_name(put) -> None:
    log = "when,displacement_mm,force_N\n12:00:00.0,1,2\n12:00:00.5,2,3\n12:00:01.0,3,4\n"
    recording = read_log(put(log))
    np.testing.assert_array_equal(recording.time, [0.0, 0.5, 1.0])
    assert "time: wall clock in column 'when'" in recording.notes


@pytest.mark.parametrize(
    ("header", "decimal"),
    [
        ("Zeit [s];Weg [mm];Kraft [N]", ","),
        ("Temps (s);Déplacement (mm);Effort (N)", ","),
        ("Tempo (s);Corsa (mm);Forza (N)", ","),
        ("Tiempo (s);Desplazamiento (mm);Fuerza (N)", ","),
        ("t/s;LVDT/mm;Load/N", "."),
    ],
)
def test_names_in_the_languages_of_rigs(put, header, decimal) -> None:
    # Used to find no column for time in a French export.
    rows = ["0.000;1.25;-56.7", "0.002;-31.50;812.5", "0.004;0.00;0.0", "0.006;4.00;-3.0"]
    content = "\n".join([header, *(row.replace(".", decimal) for row in rows)]) + "\n"
    log = read_log(put(content.encode("latin-1"), "setting_3.csv"))
    np.testing.assert_allclose(log.time, [0.0, 0.002, 0.004, 0.006])
    np.testing.assert_allclose(log.displacement, [0.00125, -0.0315, 0.0, 0.004])
    np.testing.assert_allclose(log.force, [-56.7, 812.5, 0.0, -3.0])


@pytest.mark.parametrize(
    "heading",
    [
        "Time,Position,Load,Temp\ns,in,lbf,degF",  # degF ends in a letter that may mean force
        "Time,Position,Load,Temp\nsec,inches,lbs,F",
        "Time (seconds),Position (in.),Load (pounds),Temp (F)",
        "TIME (SEC),POSITION (IN),LOAD (LBF),TEMP (F)",
    ],
)
def test_inches_and_pounds_as_people_write_them(put, heading) -> None:
    # Used to take the units row for the names: "no column for time; there are 's', 'in', ...".
    rows = "0.0,1.5,200,78.8\n0.1,-1.5,-100,78.8\n0.2,0.5,50,78.8\n"
    log = read_log(put(f"{heading}\n{rows}", "setting_3.csv"))
    np.testing.assert_allclose(log.displacement, [0.0381, -0.0381, 0.0127])
    np.testing.assert_allclose(log.force, np.array([200, -100, 50]) * 4.4482216152605)
    np.testing.assert_allclose(log.temperature, 26.0)


def test_a_units_row_in_volts_is_no_row_of_names(put) -> None:
    # V alone may be a velocity; used to find columns named 's', 'V' and 'V'.
    log = put("Time,Displacement,Force\ns,V,V\n0.0,1,2\n0.1,2,3\n0.2,3,4\n", "setting_3.csv")
    with pytest.raises(LogError, match=r"'Displacement': no unit.*'V'.*For volts.*rig\.scales"):
        read_log(log)
    scaled = ReadOptions(
        units={"displacement": "mm", "force": "N"}, scales={"displacement": 10, "force": 100}
    )
    np.testing.assert_allclose(read_log(log, scaled).force, [200.0, 300.0, 400.0])


def test_a_german_mts_export_counts_in_sek(put) -> None:
    head = "MTS793|MPT|DEU|1|2|,|.|:|1|0|0|A\n\nData Acquisition: zyklisch\nZeit\tWeg\tKraft\n"
    log = put(head + "Sek\tmm\tkN\n0,0\t1,5\t0,2\n0,1\t-1,5\t0,3\n0,2\t2,5\t0,1\n", "setting_3.dat")
    np.testing.assert_allclose(read_log(log).force, [200.0, 300.0, 100.0])


def test_stamps_in_whole_seconds_ask_for_the_rate(put) -> None:
    # Used to suggest that each repeated stamp began another test.
    rows = "".join(f"10:00:0{i // 5},{i % 3},5\n" for i in range(20))
    with pytest.raises(LogError, match=r"time repeats.*coarser.*rig\.sample_rate"):
        read_log(put(f"Time,Displacement (mm),Force (N)\n{rows}", "setting_3.csv"))


@pytest.mark.parametrize("bad", ["End of test", "0.3,OVR,3"])
def test_a_bad_row_says_how_to_drop_it(put, bad) -> None:
    rows = "0.0,1,2\n0.1,2,3\n0.2,3,4\n"
    log = put(f"time_s,displacement_mm,force_N\n{rows}{bad}\n", "setting_3.csv")
    with pytest.raises(LogError, match=r"line 5: .*rig\.bad_rows = 'drop'"):
        read_log(log)
