"""Text logs: what rigs write and the arrays it must give; what cannot be read and why."""

import gzip
import hashlib
import os
import zlib
from pathlib import Path

import numpy as np
import pytest

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_log, read_logs
from tests.io.scenarios import HEADER, Scenario, text

PLAIN = text(Scenario())
NAMES = "time_s,displacement_mm,force_N"
ROWS = "0.0,1,2\n0.1,2,3\n0.2,3,4\n0.3,4,5\n"
CHANNELS = {"time": 1, "displacement": 3, "force": 2}


def refusal(path: Path, **declared) -> str:
    """The one line that says why there is no log."""
    with pytest.raises(LogError) as caught:
        read_logs(path, ReadOptions(**declared))
    message = str(caught.value)
    assert message.isprintable()
    assert path.name.partition(".")[0] in message
    return message.removeprefix(path.name)


# What is read: log, declarations, and time in s, displacement in mm, force in N, temperature in
# degC as far as they are told, and what a note or finding says.
INCHES = "0.0,1.5,200,78.8\n0.1,-1.5,-100,78.8\n0.2,0.5,50,78.8\n"
POUNDS = ([0.0, 0.1, 0.2], [38.1, -38.1, 12.7], np.array([200, -100, 50]) * 4.4482216152605, [26.0])
EURO = "0.000;1.25;-56.7\n0.002;-31.50;812.5\n0.004;0.00;0.0\n0.006;4.00;-3.0\n"
EURO_VALUES = ([0.0, 0.002, 0.004, 0.006], [1.25, -31.5, 0.0, 4.0], [-56.7, 812.5, 0.0, -3.0])
SHORT = "Time,Position,Load,Temp"


def stamped(*stamps: str) -> str:
    rows = "".join(f"{stamp};{i};{i}\n" for i, stamp in enumerate(stamps))
    return f"time;displacement_mm;force_N\n{rows}"


READ = {
    "declared columns, units, signs": (
        "a,b,c\n0,1,2\n10,3,4\n",
        {
            "columns": {"time": 1, "displacement": "c", "force": "b"},
            "units": {"time": "ms", "displacement": "mm", "force": "kN"},
            "reverse_force": True,
            "reverse_displacement": True,
        },
        ([0.0, 0.01], [-2, -4], [-1000, -3000]),
        "force: sign reversed",
    ),
    "no names": (
        "0\t1\t2\n10\t3\t4\n",
        {"columns": CHANNELS, "units": {"time": "ms", "displacement": "mm", "force": "gf"}},
        ([0.0, 0.01], [2, 4], [0.00980665, 0.02941995]),
        "separator: tab",
    ),
    "volts beside units": (
        ("Time (s),Force (V),Force (N),Displacement (V),Displacement (mm),Temperature (V),"
        "Temperature (C)\n0,9,1,9,2,9,3\n1,9,4,9,5,9,6\n"),
        {},
        ([0, 1], [2, 5], [1, 4], [3, 6]),
        "",
    ),
    "cut last row": (PLAIN + "0.010,1,-12", {}, (Scenario().time,), "no final newline"),
    "separator at every end": (
        PLAIN.replace("\n", ",\n").replace(",\n", "\n", 1), {},
        (Scenario().time, Scenario().displacement_mm, Scenario().force_n), "ends in a separator",
    ),
    "no temperature": (
        f"{HEADER}\n0,1,2,26\n1,2,3,1e308\n2,3,4,26\n", {}, ([0, 1, 2], None, None, None),
        "temperature: left out; 1 of 3 values are missing",
    ),
    "ISO stamps over midnight": (
        ("Timestamp,RPM,Force (N),Displacement (mm),Velocity (m/s),Temperature (C)\n"
        "2023-03-01T23:59:59.998000+01:00,90,1.0,12.7,9,26.1\n"
        "2023-03-02T00:00:00.001000+01:00,90,2.0,12.8,9,26.2\n"
        "2023-03-02T00:00:00.004000+01:00,90,3.0,12.9,9,26.3\n"), {},
        ([0.0, 0.003, 0.006], [12.7, 12.8, 12.9], [1, 2, 3], [26.1, 26.2, 26.3]),
        "time: wall clock in column 'Timestamp'",
    ),
    "stamps over midnight": (stamped("23:59:59", "00:00:00", "00:00:01"), {}, ([0, 1, 2],), ""),
    "twelve is midnight": (
        stamped("11:59:59 PM", "12:00:00 AM", "12:00:01 a.m."), {}, ([0, 1, 2],), "",
    ),
    "German stamps": (
        stamped("31.12.2023 23:59:59,250", "31.12.2023 23:59:59,750", "01.01.2024 00:00:00,250"),
        {}, ([0, 0.5, 1],), "",
    ),
    "rate of the preamble": (
        "Sampling Rate: 500 Hz\nsample;displacement_mm;force_N\n0;0;0\n1;1;2\n2;2;4\n", {},
        ([0, 0.002, 0.004], [0, 1, 2], [0, 2, 4]), "time: 500 Hz, from the preamble",
    ),
    "bad rows dropped": (
        (b"0 1000 1.0\n10 2000 1.5\r\n20 \x00000 2.0\n30 START 2.0\n40 nan 2.0\n50 4000\n"
        b"60 5000 2.5\n"),
        {
            "columns": CHANNELS, "units": {"time": "ms", "force": "gf", "displacement": "cm"},
            "bad_rows": "drop",
        },
        ([0, 0.01, 0.06], [10, 15, 25], [9.80665, 19.6133, 49.03325]),
        "4 rows that cannot be read dropped; log.csv, line 3: ",
    ),
    "restart: the last": (
        f"{NAMES}\n5,0,0\n6,1,1\n0,2,2\n1,3,3\n2,4,4\n", {"restarts": "last"},
        ([0, 1, 2], [2, 3, 4]), "",
    ),
    "a long preamble": (
        "".join(f"Note {i}; made on 1; 2; of 3\n" for i in range(60)) + PLAIN.replace(",", ";"),
        {}, (Scenario().time, None, Scenario().force_n), "preamble: 60 lines above the names",
    ),
    "declared marks": (
        f'{NAMES}\n"0,5","1.000,5","-12.345.678"\n"1,5","2,5","3"\n',
        {"decimal": ",", "thousands": "."}, ([0.5, 1.5], [1000.5, 2.5], [-12345678, 3]), "",
    ),
    "declared separator and encoding": (
        "time_s|x_\u00b5m|force_N|1;2\n0|10|20|1;2\n1|20|30|1;2\n".encode("utf-16-le"),
        {"encoding": "utf-16-le", "separator": "|"}, ([0, 1], [0.01, 0.02], [20, 30]),
        "encoding: utf-16-le, as declared",
    ),
    **{
        f"names: {names}": (
            (names + "\n" + EURO.replace(".", mark)).encode("latin-1"), {}, EURO_VALUES, "",
        )
        for names, mark in {
            "Messzeit [s];Kolbenweg [mm];D\u00e4mpferkraft [N]": ",",
            "ts (s);stroke actual (mm);Load (N)": ".",
            "Temps (s);D\u00e9placement (mm);Effort (N)": ",",
            "Tempo (s);Corsa (mm);Forza (N)": ",",
            "Tiempo (s);Desplazamiento (mm);Fuerza (N)": ",",
            "t/s;LVDT/mm;Load/N": ".",
        }.items()
    },
    **{
        f"inches: {heading}": (f"{heading}\n{INCHES}", {}, POUNDS, "")
        for heading in (
            f"{SHORT}\ns,in,lbf,degF",
            f"{SHORT}\nsec,inches,lbs,F",
            "Time (seconds),Position (in.),Load (pounds),Temp (F)",
            "TIME SECONDS,POSITION INCHES,LOAD POUNDS,TEMP (F)",
        )
    },
    "a command beside": (
        "time_s,travel cmd (mm),travel now (mm),force_N\n0,9,1,2\n1,9,2,3\n", {},
        ([0, 1], [1, 2], [2, 3]), "displacement: column 'travel now (mm)'",
    ),
    "one field short throughout": (
        f"Time (s),Displacement (mm),Force (N),Marker (V)\n{ROWS}", {},
        ([0, 0.1, 0.2, 0.3], [1, 2, 3, 4], [2, 3, 4, 5]), "the last, 'Marker (V)', was taken to",
    ),
    "one field short but for one row": (
        f"Time (s),Displacement (mm),Force (N),Marker (V)\n{ROWS}0.4,5,6,9\n0.5,6,7\n", {},
        (None, [1, 2, 3, 4, 5, 6], [2, 3, 4, 5, 6, 7]), "most rows 3 fields",
    ),
    **{
        f"large units: {name}": (
            f"time_s;displacement_mm;{name}\n0;1;2\n1;2;3\n2;3;-4\n", {},
            (None, None, newtons * np.array([2.0, 3.0, -4.0])), "",
        )
        for name, newtons in {
            "force_daN": 10.0, "Load (kip)": 4448.2216152605, "force, tf": 9806.65,
        }.items()
    },
    **{
        f"time in {unit}": (
            f"time_{unit},displacement_mm,force_N\n0,1,2\n1,1,2\n3,1,2\n", {"pause": 1e4},
            ([0, seconds, 3 * seconds],), "",
        )
        for unit, seconds in {"ms": 1e-3, "msec": 1e-3, "us": 1e-6, "min": 60.0}.items()
    },
}  # fmt: skip


@pytest.mark.parametrize("case", READ)
def test_what_is_read(put, case) -> None:
    log, declared, expected, says = READ[case]
    recording = read_log(put(log), ReadOptions(**declared))
    channels = zip(("time", "displacement", "force", "temperature"), expected, strict=False)
    for channel, values in channels:
        found = getattr(recording, channel)
        if values is None:
            assert channel != "temperature" or found is None
            continue
        scale = 1e-3 if channel == "displacement" else 1.0
        told = np.broadcast_to(scale * np.array(values, float), found.shape)
        np.testing.assert_allclose(found, told, rtol=1e-13, atol=1e-13, err_msg=channel)
    said = [*recording.notes, *map(str, recording.findings)]
    assert any(says in one for one in said) or not says, said


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("velocity_mm/s", [1.0, 2.0, -3.5], 1e-3),
        ("Velocity (m/s)", [1.0, 2.0, -3.5], 1.0),
        ("Axial Velocity (in/s)", [1.0, 2.0, -3.5], 0.0254),
        ("velocity", [1.0, 2.0, 3.0], "velocity: left out; it has no unit"),
        ("speed (rpm)", [90, 90, 90], "velocity: left out; column 'speed (rpm)'"),
        ("velocity_m/s", [1.0, "nan", 3.0], "velocity: left out; 1 of 3 values are missing"),
        ("velocity_m/s,speed_m/s", ["1,1", "2,2", "3,3"], "velocity: left out; it could be column"),
    ],
)
def test_a_velocity_is_read_or_left_out_aloud(put, name, values, expected) -> None:
    rows = "".join(f"{k},{k},{10 * k},{value}\n" for k, value in enumerate(values))
    log = read_log(put(f"{NAMES},{name}\n{rows}"))
    if isinstance(expected, str):
        assert log.velocity is None
        assert any(expected in note for note in log.notes)
    else:
        assert log.velocity == pytest.approx(expected * np.array(values))


# What is refused: log, declarations, what the sentence says.
def with_row(row: str) -> str:
    """Put a bad row in line 4 of a log of 20 rows."""
    rows = [f"{i / 100},{i},{2 * i},26" for i in range(20)]
    rows[2] = row
    return "\n".join([HEADER, *rows]) + "\n"


def quoted(*rows: str) -> str:
    lines = (",".join(f'"{field}"' for field in row.split()) for row in rows)
    return "\n".join([NAMES, *lines]) + "\n"


BAD_ROWS = {
    "0.02,1,2,26,9": "line 4: found 5 fields, expected 4",
    "End of test": "line 4: found 1 field, expected 4 fields as in line 1; repair the row, or",
    "0.02,OVR,2,26": "line 4: displacement is 'OVR', expected a number; repair the row, or drop",
    "0.02,1_000,2,26": "line 4: displacement is '1_000'",
    "0.02,1,2,#NV": "line 4: temperature is '#NV'",
    '0.02,1,"1,234",26': "line 4: force is '1,234', expected a number; if it has a mark of thousan",
    "0.02,nan,2,26": "line 4: displacement is blank, NaN or infinite, in 1 of 20",
    "0.005,1,2,26": "line 4: time runs backwards: 0.005 s after 0.01",
    '0.02,"1,2,26': "line 4: a quote opens and does not close",
    "\n\n0.02,OVR,2,26": "line 6: displacement is 'OVR'",
    "0.02,1,\0,26": f"line 4: NUL byte at byte offset {len(HEADER) + 31}",
}
REFUSED = {
    **{repr(row): (with_row(row), {}, says) for row, says in BAD_ROWS.items()},
    "empty": ("", {}, "empty file (0 bytes)"),
    "one row": (HEADER + "\n0,1,2,26", {}, "no data rows; the only one has no line end"),
    "prose": ("Dear all,\nno log today.\n", {}, "no rows of numbers found; line 1 is 'Dear all,'"),
    "no names": (ROWS, {}, "the columns have no names; declare the numbers"),
    "HTML": ("\n<!DOCTYPE html><html><body>404</body></html>", {}, "this is HTML"),
    "UTF-16 without mark": (PLAIN.encode("utf-16-le"), {}, "looks like UTF-16"),
    "not ASCII": ("time_s,\xe9\n", {"encoding": "ascii"}, "is not valid ASCII"),
    "never written": (bytes(4000), {}, "4000 bytes, all of them NUL; the log was never written"),
    "pickle": (b"\x80\x04\x95\x00", {}, "pickle, which could run code"),
    "binary": (bytes(range(1, 256)) * 9, {}, "binary data"),
    "endless line": ("0," * 300_000, {}, "line 1: longer than"),
    "many columns": (",".join(["1"] * 20_000) + "\n", {}, "20000 columns, more than the limit"),
    "picoseconds": (
        "time_s,displacement_mm,force_N\n0,1,2\n2e-12,2,3\n4e-12,3,4\n", {},
        "samples are 2e-12 s apart, closer than any logger takes them",
    ),
    "no clock": (
        "time_s,displacement_mm,force_N\n" + "0,1,2\n0,2,3\n0,3,4\n", {},
        "the clock stands still: declare rig.sample_rate",
    ),
    "rows twice": (
        "".join(f"{row}\n" * (1 + (k > 0)) for k, row in enumerate(PLAIN.splitlines())), {},
        "time must increase (5 such rows); these rows are there twice: remove the copies",
    ),
    "in reverse": (
        "\n".join([HEADER, *PLAIN.splitlines()[:0:-1], ""]), {},
        "time must increase (4 such rows); all rows are in reverse: sort them by time",
    ),
    "no time of day": (stamped("10:00:00", "10:00:01", "noon", "10:00:03"), {},
                       "line 4: time is 'noon', expected a time of day"),
    "all dropped": (f"{NAMES}\n" + "0,1,OVR\n" * 5, {"bad_rows": "drop"},
                    "no data rows; first: log.csv, line 2: force is 'OVR'"),
    "few lines": (PLAIN, {"skip_lines": 99}, "fewer lines than the 99 to skip"),
    "scale that overflows": (PLAIN, {"scales": {"force": 1e308}, "units": {"force": "kN"}},
                             "line 2: force is blank, NaN or infinite, in 4 of 5"),
    "units for other names": ("time;displacement;force\ns;mm\n0;1;2\n1;2;3\n2;3;4\n", {},
                              "line 2: 2 units for 3 names in line 1"),
    "two meanings of commas": (quoted("0 1,250 -1,500", "1 1,375 12,625", "2 2,000 3,000"), {},
                               "line 2: displacement is '1,250', expected a number; if it has a m"),
    **{
        f"groups: {wrong}": (
            f'time_s;displacement_mm;force_N\n0;1,234;2\n1;2.5;3\n2;"{wrong}";3\n',
            {"thousands": ","}, "line 4: displacement is",
        )
        for wrong in ("1,2345", "12,34", "1,234,", ",123", "1234,567")
    },
    # Columns: all that is wrong at once.
    "three things": (
        f"Load (kX),Zt,Displacement\n{ROWS}", {},
        ": 3 things are wrong: (1) no column for time; there are 'Load (kX)', ",
    ),
    "wrong declaration": (
        f"time,displacement,Load\n{ROWS}",
        {"columns": {"force": "Loat"}, "units": {"displacement": "mm"}},
        "(2) no column 'Loat' for force; there are 'time', 'displacement', 'Load'. Did you mean",
    ),
    "raw": ("time;x;force\ns;mm;1\n0;1;2\n1;2;3\n2;3;4\n", {}, "'force' has no unit, needed for"),
    "volts": (PLAIN.replace("force_N", "force (mV)"), {}, "declare rig.scales.force, N a mV, and"),
    "no time": ("No.,x_mm,force_N\n0,1,2\n1,2,3\n", {}, "or declare rig.sample_rate, as '500Hz'"),
    "by its unit": ("Tm[ms];x_mm;force_N;Temp[C]\n0;1;2;9\n1;2;3;9\n", {}, "you mean 'Tm[ms]'? "),
    "speed alone": ("time_s,v_mm/s,force_N\n0,1,2\n1,2,3\n", {}, "a velocity does not stand for"),
    "no force": ("time_s,front_pos_mm,v_mm_s\n0,1,2\n1,2,3\n", {}, "without a force nothing can"),
    "unknown unit": (PLAIN.replace("force_N", "force (stone)"), {}, "no unit of force 'stone'"),
    "duplicate": ("time_s,force_N,displacement_mm,force_N\n0,1,2,3\n1,2,3,4\n", {},
                  ": columns 2 and 4 are both named 'force_N'"),
    "two candidates": (
        "time_s,front force_N,displacement_mm,rear force_N\n0,1,2,3\n1,2,3,4\n", {},
        "force could be column 'front force_N' or 'rear force_N'; declare which in rig.columns",
    ),
    "names over fewer fields": (
        "Time (s),Force (N),Displacement (mm),Temperature (C)\n0.1,2\n0.2,3\n0.3,4\n", {},
        ": line 1 has 4 names, line 2 has 2 fields: correct the names, or declare the numbers and",
    ),
    "names by another separator": (
        f"Rig 7\nTime (s),Displacement (mm),Force (N)\n{ROWS.replace(',', chr(9))}", {},
        ": line 2 has 3 names (separator: comma), line 3 has 3 fields (separator: tab)",
    ),
    "the missing field is needed": (
        f"Sample,Time (s),Displacement (mm),Force (N)\n{ROWS}", {},
        "no column for force (line 1 has 4 names and most rows 3 fields: the last, 'Force (N)', ",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused(put, case) -> None:
    log, declared, says = REFUSED[case]
    assert says in refusal(put(log), **declared)


@pytest.mark.parametrize("end", ["\n", "\r", "\r\n"])
def test_one_bad_row_in_a_large_log(put, end) -> None:
    lines = [f"{i / 1000:.3f},{i % 97},{i % 89},26.0" for i in range(7_000)]
    lines[6_000] = "6.000,OVR,1,26.0"
    lines.insert(500, "")
    path = put(end.join([HEADER, *lines]) + end)
    assert "line 6003: displacement is 'OVR'" in refusal(path)
    kept = np.delete(np.arange(7_000), 6_000)
    recording = read_log(path, ReadOptions(bad_rows="drop"))
    np.testing.assert_array_equal(recording.time, np.round(kept / 1000, 3))
    np.testing.assert_array_equal(recording.force, kept % 89)
    lines[4_000], lines[6_500] = "nan,1,1,26.0", "1.0,1,1,26.0"
    path = put(end.join([HEADER, *lines]) + end)
    assert "line 6502: time runs backwards" in refusal(path, bad_rows="drop")


# Several tests in one file.


def test_names_that_stand_above_rows_again_begin_another_test(put) -> None:
    more = f"\n# setting: 8\n# Oil temp, 31 degC\n{NAMES}\n{ROWS}"
    parts = read_logs(put(f"# setting: 4\n{NAMES}\n{ROWS}{more}"))
    assert [(len(part.time), str(part.setting)) for part in parts] == [(4, "4"), (4, "8")]
    whole = f"{NAMES}\n0,1,2\n1,2,3\n2,3,4\n{NAMES}\n3,4,5\n4,5,6\n5,6,7\n"  # time runs on
    assert len(read_log(put(whole)).time) == 6


def test_restarts_pauses_and_settings_part_a_file(put) -> None:
    restart = put(f"{NAMES}\n5,0,0\n6,1,1\n0,2,2\n1,3,3\n2,4,4\n")
    assert "line 4: time runs backwards: 0 s after 6 s" in refusal(restart)
    split = read_logs(restart, ReadOptions(restarts="split"))
    assert [part.time.tolist() for part in split] == [[5.0, 6.0], [0.0, 1.0, 2.0]]
    gap = put(f"{NAMES}\n" + "".join(f"{t},1,2\n" for t in (0.0, 0.01, 0.02, 1.9, 1.91)))
    assert [len(read_logs(gap, ReadOptions(pause=s))) for s in (0.0, 1.0)] == [1, 2]
    slow = put(f"{NAMES}\n" + "".join(f"{10 * i},1,2\n" for i in range(5)))
    assert len(read_logs(slow)) == 1
    rows = "".join(f"{s},{t},{t},{t}\n" for s in (3, 1) for t in range(3))
    parts = read_logs(put(f"setting,{NAMES}\n{rows}"))
    assert [(part.setting, part.time.tolist()) for part in parts] == [
        (3, [0, 1, 2]),
        (1, [0, 1, 2]),
    ]
    with pytest.raises(LogError, match=r"^log\.csv: holds 2 tests; read_logs gives them all$"):
        read_log(put(f"setting,{NAMES}\n{rows}"))


@pytest.mark.parametrize(("n", "is_read"), [(1000, True), (1001, False)])
def test_more_than_a_thousand_tests_are_a_clock_that_jumps(put, n, is_read) -> None:
    rows = "".join(f"{100 * k + i},{i},{i}\n" for k in range(n) for i in range(2))
    path = put(f"{NAMES}\n{rows}")
    if is_read:
        assert len(read_logs(path, ReadOptions(pause=50.0))) == n
    else:
        assert f"time jumps {n - 1} times" in refusal(path, pause=50.0)


# Files.


def test_name_path_hash_and_metadata(put) -> None:
    content = "# rig: number 3\n# operator: A. B.: C\n" + PLAIN
    path = put(content)
    recording = read_log(path)
    assert (recording.name, recording.path) == ("log.csv", str(path))
    assert recording.sha256 == hashlib.sha256(content.encode()).hexdigest()
    assert recording.metadata == {"rig": "number 3", "operator": "A. B.: C"}
    assert recording.notes == ()


def test_what_a_path_names_that_is_no_log(tmp_path, put) -> None:
    (tmp_path / "link.csv").symlink_to("elsewhere.csv")
    assert "a link to elsewhere.csv, which is not there" in refusal(tmp_path / "link.csv")
    assert "no such file" in refusal(tmp_path / "none.csv")
    with pytest.raises(LogError, match="is a folder"):
        read_log(tmp_path)
    with pytest.raises(LogError, match="cannot be read"):
        read_log("a\0b.csv")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.csv")
        assert "not a regular file" in refusal(tmp_path / "pipe.csv")
    if Path("/dev/zero").exists():
        with pytest.raises(LogError, match="not a regular file"):
            read_log("/dev/zero")
    assert "more than the limit of 50 (rig.max_log_bytes)" in refusal(put(PLAIN), max_bytes=50)
    with pytest.raises(LogError) as caught:
        read_log(put("", "a\x1b[31m\nb.csv"))
    assert str(caught.value).isprintable()


def test_a_file_that_grows_while_it_is_read(put, monkeypatch) -> None:
    from damperfit.io import files

    path, read = put(PLAIN), files._read_up_to

    def grow(file, n_bytes):
        data = read(file, n_bytes)
        path.write_text(PLAIN + "0.010,1,26,2\n")
        return data

    monkeypatch.setattr(files, "_read_up_to", grow)
    assert "changed during read" in refusal(path)


# gzip


PACKED = gzip.compress(PLAIN.encode(), mtime=0)
GZIP_DAMAGE = [
    (PACKED[:-1], "truncated gzip"),
    (PACKED[:-9], "truncated gzip"),
    (PACKED[:3], "truncated gzip"),
    (PACKED + PACKED[:12], "truncated gzip"),
    (PACKED[:2] + b"\x07" + PACKED[3:], "damaged gzip: Unknown compression"),
    (PACKED[:40] + b"\xff\xff" + PACKED[42:], "damaged gzip"),
    (PACKED[:-8] + bytes(4) + PACKED[-4:], "damaged gzip: CRC check failed"),
    (PACKED[:-4] + bytes(4), "damaged gzip: Incorrect length"),
    (PACKED + b"more", "damaged gzip: odd bytes at its end"),
    (gzip.compress(PACKED, mtime=0), "a gzip inside a gzip"),
    (gzip.compress(b"", mtime=0), "empty file inside the gzip"),
]


@pytest.mark.parametrize(("data", "says"), GZIP_DAMAGE)
def test_damaged_gzip_is_one_sentence(put, data, says) -> None:
    assert says in refusal(put(data, "log.csv.gz"))


def test_gzip_in_members_and_its_limit(put) -> None:
    halves = gzip.compress(PLAIN[:60].encode()) + gzip.compress(PLAIN[60:].encode())
    for packed in (PACKED, halves, PACKED + bytes(5000), gzip.compress(b"") + PACKED):
        path = put(packed, "setting_3.csv.gz")
        for most in (max(len(PLAIN), len(packed)), 10**18):  # no memory is taken in advance
            recording = read_log(path, ReadOptions(max_bytes=most))
            assert (recording.setting, list(recording.force)) == (3, list(Scenario().force_n))
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)  # 10 kB that unpack to 10 MB
    bomb = b"".join(packer.compress(b"0,1,2\n" * 100_000) for _ in range(17)) + packer.flush()
    says = "more than the limit of 1000000 bytes when unpacked"
    assert says in refusal(put(bomb, "log.csv.gz"), max_bytes=1_000_000)
