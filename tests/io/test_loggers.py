"""What loggers write beside plain rows: each kind once, with what must be read and what is said."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_log
from tests.io import mdf_writer
from tests.io.binary_logs import needs

N = 600
TIME = np.arange(N) / 500.0
X = 20.0 * np.sin(2.0 * np.pi * 1.5 * TIME)  # mm
F = np.round(300.0 * np.cos(2.0 * np.pi * 1.5 * TIME) + 5.0 * np.sin(40.0 * np.arange(N)), 3)  # N
NAMES = "time_s,displacement_mm,force_N"


def text(time=TIME, x=X, f=F, *, names: str = NAMES, form: str = ".6f") -> str:
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


def apart(n_x: int = N // 2) -> str:
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
    x, f = 20.0 * np.sin(swing), 300.0 * np.sin(swing + 1.0)
    values = np.stack([np.rint(x / 0.05) * 0.05, np.rint(f / 5.0) * 5.0])
    kept = np.concatenate(([True], np.any(np.diff(values) != 0.0, axis=0)))
    return text(time[kept], *values[:, kept])


ALL = slice(None)
HALF = slice(None, None, 2)
READ = {
    "force of 16 bits": (text(f=rolled(F, 16, 0.008)), ALL, "rolled_over"),
    "encoder of 12 bits": (text(x=rolled(X + 20.0, 12, 0.01)), ALL, "rolled_over"),
    "microseconds of 32 bits": (
        text((1e6 * TIME + 2**32 - 600_000) % 2**32, names=NAMES.replace("_s", "_us")),
        ALL,
        "rolled_over",
    ),
    "milliseconds of 16 bits": (
        text((1e3 * TIME + 65_000) % 65_536, names=NAMES.replace("_s", "_ms", 1)),
        ALL,
        "rolled_over",
    ),
    "slower displacement": (text(x=blank(X, HALF)), slice(0, N - 1), "own_rows"),
    "slower force": (text(f=blank(F, HALF)), HALF, "own_rows"),
    "two columns of time": (apart(), slice(0, N - 1), "own_rows"),
    "a clock set forward": (clock(0.8), ALL, "clock_set"),
    "a clock set back": (clock(-0.5), ALL, "clock_set"),
    "changes only": (changes(), None, "values_held"),
    "hours": (text(TIME / 3600.0, names=NAMES.replace("_s", "_h"), form=".12f"), ALL, ""),
    "days": (text(TIME / 86_400.0, names=NAMES.replace("_s", "_days"), form=".14f"), ALL, ""),
    "timestamps": (text(names=NAMES.replace("time", "timestamps")), ALL, ""),
    "segments": (segments(0, 200, 500), ALL, ""),
    "one segment": (segments(0), ALL, ""),
    "one row of more fields": (
        text(names=NAMES + ",extra").replace("0.010000,", "0.010000,", 1),
        ALL,
        "short_rows",
    ),
    "a converter slower than the rows": (text(f=np.repeat(F[HALF], 2)), None, "values_repeated"),
    "a clean log": (text(), ALL, ""),
}


@pytest.mark.parametrize(("log", "rows", "finding"), READ.values(), ids=READ)
def test_what_is_read(tmp_path, log, rows, finding) -> None:
    path = tmp_path / ("log.lvm" if log.startswith("LabVIEW") else "log.csv")
    path.write_text(log, encoding="utf-8")
    recording = read_log(path)
    assert [one.name for one in recording.findings] == ([finding] if finding else [])
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
    ],
)
def test_stamps_that_repeat_name_the_rate_that_reads_them(tmp_path, time, rate) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text(time), encoding="utf-8")
    with pytest.raises(LogError, match=rf"share a stamp.*rig\.sample_rate = '{rate}Hz'"):
        read_log(path)
    assert len(read_log(path, ReadOptions(sample_rate=rate)).time) == N


@pytest.mark.parametrize("bad_rows", ["refuse", "drop"])
@pytest.mark.parametrize("full", [3, 300])
def test_most_rows_say_how_many_columns_there_are(tmp_path, bad_rows, full) -> None:
    lines = text(names=NAMES + ",extra").splitlines()
    lines[full] += ",9"
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if bad_rows == "refuse":
        with pytest.raises(LogError, match=rf"line {full + 1}: found 4 fields, expected 3"):
            read_log(path)
    else:
        assert len(read_log(path, ReadOptions(bad_rows="drop")).time) == N - 1


def test_a_log_without_force_says_that_nothing_can_be_fitted(tmp_path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text(names="time_s,front_pos_mm,rear_vel_mm_s"), encoding="utf-8")
    with pytest.raises(LogError, match="without a force nothing can be fitted"):
        read_log(path)


@pytest.mark.parametrize(
    "f",
    [
        np.clip(F, -200.0, 200.0),
        np.round(F),  # a coarse converter
        np.where(np.arange(N) % 100 < 50, -300.0, 300.0),  # a force that jumps
        np.where(np.arange(N) == 77, 5000.0, F),  # a spike
    ],
)
def test_what_is_no_counter_is_left_as_it_is(tmp_path, f) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text(f=f), encoding="utf-8")
    recording = read_log(path)
    assert recording.findings == ()
    np.testing.assert_allclose(recording.force, f, atol=1e-6)


def test_channels_of_tdms_that_start_at_different_times_are_read_on_one_clock(tmp_path) -> None:
    nptdms = pytest.importorskip("nptdms")
    begin = np.datetime64("2024-03-01T10:00:00.000000")
    channels = []
    for name, unit, values, late in (("displacement", "mm", X, 0), ("force", "N", F[15:], 30)):
        properties = {
            "wf_start_time": begin + np.timedelta64(late, "ms"),
            "wf_increment": 0.002,
            "unit_string": unit,
        }
        channels.append(nptdms.ChannelObject("run", name, values, properties))
    path = tmp_path / "log.tdms"
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(channels)
    recording = read_log(path)
    assert [one.name for one in recording.findings] == ["own_rows"]
    np.testing.assert_allclose(recording.time, TIME[15:], atol=1e-9)
    np.testing.assert_allclose(recording.force, F[15:])
    np.testing.assert_allclose(recording.displacement, 1e-3 * X[15:], atol=1e-9)


def test_channels_of_mdf_groups_with_rasters_of_their_own_are_read_together(tmp_path) -> None:
    needs("asammdf")
    rasters = [(TIME[::2], [("displacement", "mm", X[::2])]), (TIME, [("force", "N", F)])]
    path = tmp_path / "log.mf4"
    path.write_bytes(mdf_writer.written(*rasters))
    recording = read_log(path)
    assert [one.name for one in recording.findings] == ["own_rows"]
    np.testing.assert_allclose(recording.time, TIME[: N - 1])
    np.testing.assert_allclose(recording.force, F[: N - 1])
    np.testing.assert_allclose(1e3 * recording.displacement, X[: N - 1], atol=0.01)
