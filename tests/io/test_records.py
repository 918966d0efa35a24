"""Blocks that are one test, tests in one file, and what loggers do to channels."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.io import savemat

from damperfit.configuration.loading import load_configuration
from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_log, read_logs
from tests.io import mdf_writer
from tests.io.binary_logs import needs

# Text exports of MTS 793 as a controller writes them: one record in many write buffers.

RATE = 1024.0  # Hz
BUFFER = 1016  # rows; 0.992 s


class Record(NamedTuple):
    """What the machine recorded: s, mm, kN."""

    time: np.ndarray
    displacement: np.ndarray
    force: np.ndarray

    def rows(self, start: int, stop: int) -> "Record":
        return Record(*(channel[start:stop] for channel in self))


def record(seconds: float = 78.0) -> Record:
    """A rest, 13 speeds from 0.2 to 10 Hz at 3 to 4 cycles each without a pause, a slow ramp."""
    n_all = int(seconds * RATE)
    time = np.arange(n_all) / RATE
    displacement = np.zeros(n_all)
    end = 2.0  # s, of the rest
    for f in np.geomspace(0.2, 10.0, 13):
        amplitude = min(25.0, 1000.0 * 0.4 / (2.0 * np.pi * f))  # mm, at most 0.4 m/s
        start, end = end, end + (3 if f < 1.0 else 4) / f
        is_in = (time >= start) & (time < end)
        displacement[is_in] = amplitude * np.sin(2.0 * np.pi * f * (time[is_in] - start))
    ramp = time >= end
    displacement[ramp] = (time[ramp] - end) / 20.0 * 10.0
    v = np.gradient(displacement, time) / 1000.0
    force = 2.0 * v + 0.8 * v * np.abs(v) + 0.03 * np.tanh(v / 0.002) - 0.13
    return Record(time, displacement, force)


def blocks_of(whole: Record, buffer: int = BUFFER) -> list[Record]:
    """The record as it is written, buffer by buffer."""
    return [whole.rows(i, i + buffer) for i in range(0, len(whole.time), buffer)]


def export(blocks: list[Record]) -> str:
    """The file: a line of the format, then header, names, units and rows of each block."""
    lines = ["MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A", ""]
    for block in blocks:
        lines += [
            "Data Acquisition: Timed\t\tTime:\t1.0197\tSec\t3/29/2016 1:54:32 PM",
            "Running Time\tAxial Displacement\tAxial Force",
            "Sec\tmm\tkN",
        ]
        rows = zip(*(column.tolist() for column in block), strict=True)
        lines += [f"{t:.7f}\t{x:.6g}\t{f:.6g}" for t, x, f in rows]
        lines.append("")
    return "\r\n".join(lines) + "\r\n"


def moved_on(block: Record, seconds: float) -> Record:
    """The same rows, logged later."""
    return block._replace(time=block.time + seconds)


CONFIGS = Path(__file__).parents[2] / "configs"
SHORT = blocks_of(record(0.25), buffer=32)  # eight blocks


@pytest.fixture
def put(put):
    return lambda content, name="specimen_s3.dat": put(content, name)


# Write buffers of MTS.


def test_the_write_buffers_of_one_record_are_one_test(put) -> None:
    # Used to be a test of 1 s each, of which none could be evaluated.
    whole = record(20.0)
    found = read_log(put(export(blocks_of(whole))))
    assert (found.name, found.setting) == ("specimen_s3.dat", 3)
    np.testing.assert_allclose(found.time, whole.time, atol=1e-7)
    np.testing.assert_allclose(found.displacement, whole.displacement / 1e3, rtol=1e-5)
    np.testing.assert_allclose(found.force, whole.force * 1e3, rtol=1e-5)
    assert found.notes[0] == "part: Data Acquisition: Timed  Time: 1.0197 Sec 3/29/2016 1:54:32 PM"
    assert found.notes[-1] == "21 blocks joined, as time runs on by one step from each to the next"


def slower(block: Record, factor: float) -> Record:
    time = block.time[0] + factor * (block.time - block.time[0])
    return Record(time, block.displacement, block.force)


ORDERED = [SHORT[i] for i in (0, 1, 3, 2, 4, 5, 6, 7)]
MANY = [one for i, one in enumerate(blocks_of(record(0.25), buffer=2)) if i % 3 < 2]
BLOCKS = {  # the blocks, the samples of each test, and what is said of the breaks
    "one is missing": (
        SHORT[:3] + SHORT[4:], [96, 128],
        ("7 blocks joined, as time runs on by one step from each to the next, into 2 of 2 tests; "
        "block 4 begins at 0.125 s, 0.03223 s later than the block before ends"),
    ),
    "out of order": (
        ORDERED, [64, 32, 32, 128],
        "block 4 begins at 0.0625 s, 0.06152 s earlier than the block before ends",
    ),
    "two tests": ([SHORT[0], moved_on(SHORT[0], 20.0)], [32, 32], None),
    "a block is empty": (
        [*SHORT[:3], SHORT[0].rows(0, 0), *SHORT[3:], SHORT[0].rows(0, 0)], [256],
        "8 blocks joined",
    ),
    **{
        f"{k} steps between": (
            [SHORT[0], moved_on(SHORT[1], (k - 1.0) / RATE)], n, "joined" if len(n) < 2 else None,
        )
        for k, n in {0.55: [64], 1.45: [64], 0.45: [32, 32], 1.55: [32, 32]}.items()
    },
    **{
        f"{factor} of the rate": (
            [SHORT[0], slower(SHORT[1], factor)], n, "joined" if len(n) < 2 else None,
        )
        for factor, n in {1.45: [64], 0.7: [64], 1.55: [32, 32], 0.6: [32, 32]}.items()
    },
}  # fmt: skip


@pytest.mark.parametrize(("blocks", "samples", "says"), BLOCKS.values(), ids=BLOCKS)
def test_blocks_that_do_not_run_on_stay_tests(put, blocks, samples, says) -> None:
    parts = read_logs(put(export(blocks)))
    assert [len(part.time) for part in parts] == samples
    for part in parts:  # also of a test that is one block
        told = [note for note in part.notes if "blocks joined" in note]
        assert told if says else not told
        assert not says or says in told[0]
        assert not told or len(told[0]) < 400


def test_a_block_that_is_damaged(put) -> None:
    text = export(SHORT)
    lines = text.split("\r\n")
    at = lines.index("", 2) - 1  # last row of the first block
    lines[at] = lines[at].rpartition("\t")[0]
    path = put("\r\n".join(lines))
    with pytest.raises(LogError, match=rf"line {at + 1}: found 2 fields, expected 3.*bad_rows"):
        read_logs(path)
    parts = read_logs(path, ReadOptions(bad_rows="drop"))
    assert [len(part.time) for part in parts] == [31, 224]
    assert [one.code for part in parts for one in part.findings] == ["rows_dropped"]
    last = text.rindex("Data Acquisition")
    in_rows = read_log(put(text[: last + 300]))
    assert 224 < len(in_rows.time) < 256
    assert [one.code for one in in_rows.findings] == ["cut_row"]
    in_names = read_log(put(text[: last + 100]))
    assert len(in_names.time) == 224
    assert any(note.startswith("left out: the block in line ") for note in in_names.notes)


def test_what_blocks_say_of_themselves(put) -> None:
    head, *rest = export(SHORT).split("Running Time")
    said = [f"# setting: {1 + (i > 3)}\r\nRunning Time{block}" for i, block in enumerate(rest)]
    parts = read_logs(put(head + "".join(said)))
    assert [(part.setting, len(part.time)) for part in parts] == [(1, 128), (2, 128)]
    above = export(SHORT).replace("\r\n\r\n", "\r\nSetting: 7\r\nOperator: A\r\n", 1)
    (whole,) = read_logs(put(above, "specimen.dat"))
    assert (whole.setting, whole.metadata["operator"]) == (7, "A")
    # The decimal mark of the first line counts: the rows alone would not tell it.
    with pytest.raises(LogError, match=r"line 6: time is '0\.0000000', expected a number"):
        read_logs(put(export(SHORT).replace("|2|.|", "|2|,|")))
    with pytest.raises(LogError, match="no data rows after 'Data Acquisition' in line 1"):
        read_logs(put("Data Acquisition: Timed\n"))


# Blocks whose titles alone tell time.

STEP = BUFFER / RATE


def titled(blocks, times, *, decimal=".", last_row=""):
    lines = [f"MTS793|MPT|ENU|1|2|{decimal}|/|:|1|0|0|A", ""]
    for block, time in zip(blocks, times, strict=True):
        lines += [f"Data Acquisition: Timed\t\tTime:\t{time:.6f}\tSec\t3/29/2016 1:54:32 PM"]
        lines += ["Axial Displacement\tAxial Force", "mm\tkN"]
        lines += [f"{x:.9f}\t{f:.9f}" for x, f in zip(block.displacement, block.force, strict=True)]
        lines += [last_row] * (bool(last_row) and block is blocks[-1]) + [""]
    return "\r\n".join(lines).replace(".", decimal)


def full(n, **rows):
    blocks = blocks_of(record(n * STEP))[:n]
    return [blocks[k].rows(0, rows.get(f"b{k}", BUFFER)) for k in range(n)]


@pytest.mark.parametrize(
    ("decimal", "n_last", "at_end"), [(".", BUFFER, True), (",", 300, False), (".", 300, True)]
)
def test_blocks_that_follow_at_a_steady_rate_are_one_record(put, decimal, n_last, at_end) -> None:
    blocks = full(6, b5=n_last)
    begins = np.array([block.time[0] for block in blocks])
    lasts = np.array([len(block.time) for block in blocks]) / RATE
    (log,) = read_logs(put(titled(blocks, 12.5 + begins + lasts * at_end, decimal=decimal)))
    whole, n = record(6 * STEP), 5 * BUFFER + n_last
    np.testing.assert_allclose(log.time, np.arange(n) / RATE, rtol=1e-6)
    np.testing.assert_allclose(log.displacement, whole.displacement[:n] / 1e3, rtol=0, atol=1e-11)
    np.testing.assert_allclose(log.force, whole.force[:n] * 1e3, rtol=0, atol=1e-5)
    assert "6 blocks joined; time: 1024 Hz, by the times in their titles" in log.notes


def steps(off: float):
    return 1.0 + np.cumsum(STEP * np.array([0.0, 1.0, 1.0, 1.0 + off, 1.0]))


@pytest.mark.parametrize(
    ("blocks", "times", "is_read"),
    [
        (full(3), 1.0 + STEP * np.arange(3), True),
        (full(2), 1.0 + STEP * np.arange(2), False),  # one step may be anything
        (full(5), steps(0.0096), True),
        (full(5), steps(0.0104), False),
        (full(4, b1=500), STEP * np.arange(4), False),
        (full(3), [4.0, 4.0, 4.0], False),
        (full(3), [4.0, 3.0, 2.0], False),
    ],
)
def test_titles_that_tell_a_rate(put, blocks, times, is_read) -> None:
    path = put(titled(blocks, times))
    if is_read:
        assert len(read_logs(path)) == 1
        return
    with pytest.raises(LogError, match=r"only the titles of its blocks give a time, and no steady"):
        read_logs(path)
    assert len(read_logs(path, ReadOptions(sample_rate=RATE))) == len(blocks)


# Several tests in one file: pauses of a logger, and the profiles in configs/.

PREAMBLE = (
    "Header Size:  7\r\nVersion:  2\r\nSampling Interval:  0.005\r\nSampling Rate:  200\r\n"
    "Sample Count:  15\r\nDevice Serial Number:  0\r\n"
    "Sample Number, Date/Time, CHANNEL0, CHANNEL1, Events\r\n"
)


def logger(force: str, displacement: str, *, force_first: bool = True) -> str:
    """Five tests of three rows, two minutes apart, across noon."""
    volts = (force, displacement) if force_first else (displacement, force)
    rows = []
    for i in range(15):
        test, sample = divmod(i, 3)
        event = {0: ", DAQ Resume", 2: ", DAQ Pause"}.get(sample, "")
        hour, minute = divmod(11 * 60 + 56 + 2 * test, 60)
        rows.append(
            f"{i + 1:10d},   04/29/2022 {hour}:{minute:02d}:00.{5 * sample:03d} "
            f"{'AM' if hour < 12 else 'PM'}, {volts[0]}, {volts[1]}{event}\r\n"
        )
    return PREAMBLE + "".join(rows)


@pytest.mark.parametrize(
    ("name", "force_first"), [("ME25mm0x5Hz.txt", True), ("ME5mm3Hz.txt", False)]
)
def test_logger_of_the_mts_machine(put, name, force_first) -> None:
    options = load_configuration(CONFIGS / "mr_damper_mts.toml").reading
    parts = read_logs(put(logger("0.0320", "-2.9931", force_first=force_first), name), options)
    assert [part.setting for part in parts] == [0, 25, 50, 75, 100]
    for k, part in enumerate(parts):
        np.testing.assert_allclose(part.time, 120.0 * k + np.array([0.0, 0.005, 0.01]), atol=1e-12)
        np.testing.assert_allclose(part.force, 0.0320 * 980.665, rtol=1e-14)
        np.testing.assert_allclose(part.displacement, -29.931e-3, rtol=1e-14)
        assert part.metadata["sampling rate"] == "200"


def test_a_logger_and_what_is_declared_of_it(put) -> None:
    path = put(logger("1", "2"), "log.txt")
    declared = {
        "columns": {"displacement": "CHANNEL1", "force": "CHANNEL0"},
        "units": {"displacement": "mm", "force": "N"},
    }
    with pytest.raises(LogError, match="no column for displacement and force; there are 'Sample"):
        read_logs(path)
    rate = read_logs(path, ReadOptions(**declared, sample_rate=200.0))
    assert [part.time.tolist() for part in rate] == [[0.0, 0.005, 0.01]] * 5
    assert [part.name for part in rate][::4] == ["log.txt part 1", "log.txt part 5"]
    labels = ("R12 C8", "12r/6c", "R-1 C2.5", "1/2", "R3 C4")
    two = {**declared, "adjusters": ("rebound", "compression")}
    parts = read_logs(path, ReadOptions(**two, part_settings=labels))
    assert [str(part.setting) for part in parts][:3] == ["R12 C8", "R12 C6", "R-1 C2.5"]
    for settings, says in {
        ("R1 C1", "12", "R1 C2", "1/1", "1/2"): "part_settings: setting '12'; expected a place for",
        ("R1 C1",): "5 tests found, but 1 settings declared",
    }.items():
        with pytest.raises(LogError, match=says):
            read_logs(path, ReadOptions(**two, part_settings=settings))
    path.write_text(path.read_text().replace("DAQ Pause", "DAQ, Pause", 1))
    with pytest.raises(LogError, match="line 10: found 6 fields, expected 5 fields as in line 7"):
        read_logs(path, ReadOptions(**declared))


@pytest.mark.parametrize(
    ("name", "setting"),
    [("ensaio1", 0), ("ensaio.A.2", 321)],
)
def test_matlab_files_with_left_over_variables(tmp_path, name, setting) -> None:
    time = np.arange(30)[:, np.newaxis] * 0.01
    beside = {"x_F": np.hstack([time] * 3), "tout": time, "f": 1.5, "tt": np.zeros((1, 7))}
    columns = {"Tout": time, "dist": 10.0 * np.sin(time), "forc": 100.0 * np.cos(time)}
    savemat(tmp_path / f"{name}.mat", {**columns, **beside})
    options = load_configuration(CONFIGS / "mr_damper_table.toml").reading
    (recording,) = read_logs(tmp_path / f"{name}.mat", options)
    assert recording.setting == setting
    np.testing.assert_array_equal(recording.time, time.ravel())
    np.testing.assert_allclose(recording.displacement, 0.01 * np.sin(time.ravel()), rtol=1e-15)
    np.testing.assert_array_equal(recording.force, 100.0 * np.cos(time.ravel()))


# What loggers do to channels: each kind once, with what must be read and what is said.

N = 600
TIME = np.arange(N) / 500.0
X = 20.0 * np.sin(2.0 * np.pi * 1.5 * TIME)  # mm
F = np.round(300.0 * np.cos(2.0 * np.pi * 1.5 * TIME) + 5.0 * np.sin(40.0 * np.arange(N)), 3)  # N
NAMES = "time_s,displacement_mm,force_N"


def rows_of(time=TIME, x=X, f=F, *, names: str = NAMES, form: str = ".6f") -> str:
    def field(value) -> str:
        return "" if np.isnan(value) else f"{value:{form}}"

    rows = (",".join(map(field, row)) for row in zip(time, x, f, strict=True))
    return "\n".join([names, *rows]) + "\n"


def rolled(values, bits: int, quantum: float):
    """The values as a counter of so many bits writes them."""
    half = 2 ** (bits - 1)
    return ((np.rint(np.asarray(values) / quantum) + half) % (2 * half) - half) * quantum


def blank(values, keep: slice):
    blanked = np.full(len(values), np.nan)
    blanked[keep] = np.asarray(values)[keep]
    return blanked


def columns_of_time(kind: str, late: float = 0.0) -> str:
    """LabVIEW text with no column of time, or with one a channel, the displacement's late."""
    text = f"LabVIEW Measurement\t\nX_Columns\t{kind}\n***End_of_Header***\t\nChannels\t2\t\n"
    second = "\tX_Value" * (kind == "Multi")
    text += f"Y_Unit_Label\tNewtons{second and chr(9)}\tMillimeters\nDelta_X\t0.002\t0.002\n"
    text += f"***End_of_Header***\t\nX_Value\tForce{second}\tDisplacement\tComment\n"
    for t, f, x in zip(TIME, F, X, strict=True):
        text += f"{t:.6f}\t{f:.6f}\t{t + late:.6f}\t{x:.6f}\t\n" if second else f"\t{f}\t{x}\t\n"
    return text


def segments(*starts: int) -> str:
    head = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\n***End_of_Header***\t\n"
    for first, stop in zip(starts, [*starts[1:], N], strict=True):
        head += "\t\nNotes\tdamper 7\nChannels\t2\t\nY_Unit_Label\tNewtons\tMillimeters\t\n"
        head += "***End_of_Header***\t\t\nX_Value\tForce\tDisplacement\tComment\n"
        for k in range(first, stop):
            comment = "\tbegins" if k == first else ""
            head += f"{TIME[k]:.6f}\t{F[k]:.6f}\t{X[k]:.6f}{comment}\n"
    return head


def clock(late: float) -> str:
    """Rows by a wall clock that is set in the middle of the motion."""
    stamps = 36_000.0 + TIME + np.where(np.arange(N) > 301, late, 0.0)
    rows = (
        f"10:{int(t - 36_000) // 60:02}:{t % 60:06.3f},{x:.6f},{f:.6f}"
        for t, x, f in zip(stamps, X, F, strict=True)
    )
    return "\n".join(["clock,displacement_mm,force_N", *rows]) + "\n"


def apart() -> str:
    """Two columns of time, the displacement at half the rate."""
    rows = [f"{t:.6f},{f:.6f}" for t, f in zip(TIME, F, strict=True)]
    slow = [f",{t:.6f},{x:.6f}" for t, x in zip(TIME[::2], X[::2], strict=True)]
    slow += [",,"] * (N - len(slow))
    lines = (a + b for a, b in zip(rows, slow, strict=True))
    return "\n".join(["Time (s),Force (N),Time (s),Displacement (mm)", *lines]) + "\n"


def changes(tick: float = 1e-3) -> str:
    """Rows of a logger that writes what differs from the row before, at 5 N and 0.05 mm."""
    time = np.arange(0.0, 2.0, tick)
    swing = np.where(time < 0.5, 0.0, 2.0 * np.pi * 1.5 * (time - 0.5))
    friction = 15.0 * np.sign(np.cos(swing)) * (time >= 0.5)
    x, f = 20.0 * np.sin(swing), 300.0 * np.sin(swing + 1.0) + friction
    values = np.stack([np.rint(x / 0.05) * 0.05, np.rint(f / 5.0) * 5.0])
    kept = np.concatenate(([True], np.any(np.diff(values) != 0.0, axis=0)))
    return rows_of(time[kept], *values[:, kept])


def in_turn() -> str:
    """Two time bases in one column, blank where the other has its value alone."""
    at = np.arange(N)
    f, x = np.where(at % 6 == 5, np.nan, F), np.where(at % 3 == 2, X, np.nan)
    return rows_of(x=x, f=f).replace("nan", "")


ALL = slice(None)
HALF = slice(None, None, 2)
READ = {
    "force of 16 bits": (rows_of(f=rolled(F, 16, 0.008)), ALL, "rolled_over"),
    "force of 15 bits": (rows_of(f=rolled(F, 15, 0.008)), ALL, "rolled_over"),
    "encoder of 12 bits": (rows_of(x=rolled(X + 20.0, 12, 0.01)), ALL, "rolled_over"),
    "seconds of a millisecond counter of 16 bits": (
        rows_of((TIME + 65.0) % 65.536, form=".3f"),
        None,
        "rolled_over",
    ),
    "a date in seconds, set back": (
        rows_of(1.7e9 + TIME - 0.9 * (np.arange(N) > 301)),
        None,
        "clock_set",
    ),
    "no column of time": (columns_of_time("No"), ALL, ""),
    "a column of time a channel": (columns_of_time("Multi"), ALL, ""),
    "a column of time a channel, one late": (columns_of_time("Multi", 0.001), None, "own_rows"),
    "a converter at 2 of 5 rows": (
        rows_of(f=F[np.floor(np.floor(np.arange(N) / 2.5) * 2.5).astype(int)]),
        None,
        "values_repeated",
    ),
    "slower displacement": (rows_of(x=blank(X, HALF)), slice(0, N - 1), "own_rows"),
    "force at 5 of 6 rows, displacement at 1 of 3": (in_turn(), None, "own_rows"),
    "blank rows at the end": (rows_of() + ",,\n" * 3, ALL, ""),
    "seconds of a microsecond counter of 20 bits": (
        rows_of((TIME + 0.5) % 1.048576),
        ALL,
        "rolled_over",
    ),
    "two columns of time": (apart(), slice(0, N - 1), "own_rows"),
    "a clock set forward": (clock(0.8), ALL, "clock_set"),
    "changes only": (changes(), None, "values_held"),
    "hours": (rows_of(TIME / 3600.0, names=NAMES.replace("_s", "_h"), form=".12f"), ALL, ""),
    "segments": (segments(0, 200, 500), ALL, ""),
    "a converter slower than the rows": (rows_of(f=np.repeat(F[HALF], 2)), None, "values_repeated"),
    "a clean log": (rows_of(), ALL, ""),
}


@pytest.mark.parametrize(("log", "rows", "finding"), READ.values(), ids=READ)
def test_what_is_read(tmp_path, log, rows, finding) -> None:
    path = tmp_path / ("log.lvm" if log.startswith("LabVIEW") else "log.csv")
    path.write_text(log, encoding="utf-8")
    recording = read_log(path)
    assert {one.code for one in recording.findings} == {finding} - {""}
    if rows is None:
        assert finding != "values_held" or np.allclose(np.diff(recording.time), 1e-3)
        return
    np.testing.assert_allclose(recording.time - recording.time[0], TIME[rows], atol=1e-5)
    off = recording.force - F[rows]  # a counter does not say where it began, and rounds
    assert np.ptp(off) < 0.01
    off = 1e3 * recording.displacement - X[rows]
    assert np.ptp(off) < 0.02


@pytest.mark.parametrize(
    ("time", "rate"),
    [
        (np.floor(np.arange(N) / 2.0) / 250.0, 500),  # two rows a stamp
        (np.rint(256.0 * (40_000.0 + TIME)) / 256.0, 500),  # single precision
        (np.floor(500.0 * TIME + 0.9 * np.sin(np.arange(N))) / 500.0 + 1.0, 500),
    ],
)
def test_stamps_that_repeat_name_the_rate_that_reads_them(tmp_path, time, rate) -> None:
    path = tmp_path / "log.csv"
    path.write_text(rows_of(time), encoding="utf-8")
    with pytest.raises(LogError, match=rf"share a stamp.*rig\.sample_rate = '{rate}Hz'"):
        read_log(path)
    assert len(read_log(path, ReadOptions(sample_rate=rate)).time) == N


@pytest.mark.parametrize(
    "f",
    [
        np.clip(F, -200.0, 200.0),
        np.round(F),  # a coarse converter
        np.where(np.arange(N) % 100 < 50, -300.0, 300.0),  # a force that jumps
        np.where(np.arange(N) == 77, 9999.0, np.round(F, 2)),  # a spike by nearly 2^20 steps
        np.floor(np.arange(N) / 2.5),  # a coarse converter at one speed
    ],
)
def test_what_is_no_counter_is_left_as_it_is(tmp_path, f) -> None:
    path = tmp_path / "log.csv"
    path.write_text(rows_of(f=f), encoding="utf-8")
    recording = read_log(path)
    assert recording.findings == ()
    np.testing.assert_allclose(recording.force, f, atol=1e-6)


def test_a_jump_over_a_gap_is_no_counter(put) -> None:
    # Rows lost from the largest force to the smallest: 12 bits of 1 N, to the newton.
    force = np.where(np.arange(N) < 300, np.arange(N), np.arange(N) - 4_095.0)
    late = TIME + 0.3 * (np.arange(N) >= 300)
    assert read_log(put(rows_of(late, X, force), "log.csv")).findings == ()
    assert read_log(put(rows_of(TIME, X, force), "log.csv")).findings[0].code == "rolled_over"


def test_channels_of_mdf_groups_with_rasters_of_their_own_are_read_together(tmp_path) -> None:
    needs("asammdf")
    rasters = [(TIME[::2], [("displacement", "mm", X[::2])]), (TIME, [("force", "N", F)])]
    path = tmp_path / "log.mf4"
    path.write_bytes(mdf_writer.written(*rasters))
    recording = read_log(path)
    assert [one.code for one in recording.findings] == ["own_rows"]
    np.testing.assert_allclose(recording.time, TIME[: N - 1])
    np.testing.assert_allclose(recording.force, F[: N - 1])
    np.testing.assert_allclose(1e3 * recording.displacement, X[: N - 1], atol=0.01)


@pytest.mark.parametrize("piece", [400, 1_400])
def test_pieces_between_the_pauses_of_a_logger(put, piece) -> None:
    """26 times it was said that no steady cycle was found."""
    time = np.arange(6 * piece) / 500.0
    late = time + 0.2 * (np.arange(6 * piece) // piece)
    x, f = 20.0 * np.sin(3.0 * np.pi * late), 300.0 * np.cos(3.0 * np.pi * late)
    path = put(rows_of(late, x, f), "log.csv")
    if piece == 400:  # 1.2 cycles
        with pytest.raises(LogError, match=r"after every 400 rows, .* 6 pieces of 0\.798 s"):
            read_logs(path)
        return
    assert [len(part.time) for part in read_logs(path)] == [piece] * 6
    assert len(read_logs(path, ReadOptions(pause=1.0))) == 1


@pytest.mark.parametrize(("name", "parts"), [("out [V]", 1), ("Valve current (A)", 2)])
def test_what_steps_with_the_motion_is_no_setting(put, name, parts) -> None:
    """A stepped amplitude beside its set point in volts was cut into tests without a setting."""
    step = np.where(np.arange(N) < N // 2, 1.0, 2.0)
    rows = (f"{t},{x},{f},{c}" for t, x, f, c in zip(TIME, step * X, F, step, strict=True))
    assert len(read_logs(put("\n".join([f"{NAMES},{name}", *rows]) + "\n", "log.csv"))) == parts


@pytest.mark.parametrize(
    ("current", "samples"),
    [
        (np.where(np.arange(N) < 250, 0.3, 1.6), [250, 350]),
        (np.digitize(np.arange(N), [200, 400]), [200, 200, 200]),
        (np.full(N, 0.3), [N]),
        (np.linspace(0.3, 1.6, N), [N]),
        (np.sin(TIME * 20.0), [N]),
        (np.sign(F), [N]),  # the volts of a load cell
    ],
)
@pytest.mark.parametrize("name", ["Valve current (A)", "solenoid [mA]"])
def test_a_current_that_steps_is_another_setting(put, current, samples, name) -> None:
    noisy = current + 0.01 * np.cos(1e3 * np.arange(N))
    rows = (f"{t},{x},{f},{c:.3f}" for t, x, f, c in zip(TIME, X, F, noisy, strict=True))
    path = put("\n".join([f"{NAMES},{name}", *rows]) + "\n", "log.csv")
    parts = read_logs(path)
    assert [len(part.time) for part in parts] == samples
    warned = [one.severity for one in parts[0].findings]
    assert warned == ["warning"] * (len(samples) > 1)
    named = read_logs(path, ReadOptions(part_settings=tuple(range(len(samples)))))
    assert [one.severity for one in named[0].findings] == ["note"] * (len(samples) > 1)
