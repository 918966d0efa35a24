"""One record in many blocks is one test; blocks that do not run on stay tests of their own."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_log, read_logs
from tests.io.mts_files import RATE, Record, blocks_of, export, moved_on, record

SHORT = blocks_of(record(0.25), buffer=32)  # eight blocks


def _put(tmp_path, text: str):
    path = tmp_path / "specimen_s3.dat"
    path.write_bytes(text.encode())
    return path


def _joined_note(recording) -> str:
    (note,) = [note for note in recording.notes if "blocks joined" in note]
    return note


def test_the_write_buffers_of_one_record_are_one_test(tmp_path) -> None:
    # Used to be 79 tests of 1 s, of which none could be evaluated.
    whole = record()
    blocks = blocks_of(whole)
    assert len(blocks) == 79
    found = read_log(_put(tmp_path, export(blocks)))
    assert found.name == "specimen_s3.dat"
    assert found.setting == 3
    np.testing.assert_allclose(found.time, whole.time, atol=1e-7)
    np.testing.assert_allclose(found.displacement, whole.displacement / 1e3, rtol=1e-5)
    np.testing.assert_allclose(found.force, whole.force * 1e3, rtol=1e-5)
    assert found.notes == (
        "part: Data Acquisition: Timed  Time: 1.0197 Sec 3/29/2016 1:54:32 PM",
        "MTS 793 export, language ENU",
        "separator: tab",
        "time: column 'Running Time'",
        "displacement: column 'Axial Displacement'",
        "force: column 'Axial Force'",
        "setting: from the file name",
        "79 blocks joined, as time runs on by one step from each to the next",
    )


def test_a_missing_block_is_a_gap_that_is_told(tmp_path) -> None:
    parts = read_logs(_put(tmp_path, export(SHORT[:3] + SHORT[4:])))
    assert [part.name for part in parts] == [f"specimen_s3.dat part {i}" for i in (1, 2)]
    assert [len(part.time) for part in parts] == [96, 128]
    assert _joined_note(parts[0]) == (
        "7 blocks joined, as time runs on by one step from each to the next, into 2 of 2 tests; "
        "block 4 begins at 0.125 s, 0.03223 s later than the block before ends"
    )
    assert _joined_note(parts[1]) == _joined_note(parts[0])


def test_blocks_out_of_order_stay_tests_and_are_told(tmp_path) -> None:
    order = [0, 1, 3, 2, 4, 5, 6, 7]
    parts = read_logs(_put(tmp_path, export([SHORT[i] for i in order])))
    assert [len(part.time) for part in parts] == [64, 32, 32, 128]
    note = _joined_note(parts[1])  # also of a test that is one block
    assert "block 4 begins at 0.0625 s, 0.06152 s earlier than the block before ends" in note


def test_of_many_breaks_the_first_are_told(tmp_path) -> None:
    every = blocks_of(record(0.25), buffer=2)
    assert len(every) == 128
    parts = read_logs(_put(tmp_path, export([one for i, one in enumerate(every) if i % 3 < 2])))
    assert [len(part.time) for part in parts] == [4] * 43
    note = _joined_note(parts[0])
    assert note.count("begins at") == 3
    assert note.endswith("; and 39 more")
    assert len(note) < 400


def test_time_that_starts_again_begins_another_test(tmp_path) -> None:
    parts = read_logs(_put(tmp_path, export([*SHORT[:2], *SHORT[:3]])))
    assert [len(part.time) for part in parts] == [64, 96]
    np.testing.assert_array_equal(parts[1].time[0], 0.0)


def test_separate_tests_are_not_spoken_of_as_joined(tmp_path) -> None:
    parts = read_logs(_put(tmp_path, export([SHORT[0], moved_on(SHORT[0], 20.0)])))
    assert len(parts) == 2
    assert not any("joined" in note for part in parts for note in part.notes)


@pytest.mark.parametrize(("steps", "n_tests"), [(0.55, 1), (1.45, 1), (0.45, 2), (1.55, 2)])
def test_how_far_a_step_between_blocks_may_be_off(tmp_path, steps, n_tests) -> None:
    late = moved_on(SHORT[1], (steps - 1.0) / RATE)
    assert len(read_logs(_put(tmp_path, export([SHORT[0], late])))) == n_tests


@pytest.mark.parametrize(("slower", "n_tests"), [(1.45, 1), (1.55, 2), (0.7, 1), (0.6, 2)])
def test_how_far_the_rates_of_two_blocks_may_differ(tmp_path, slower, n_tests) -> None:
    after = SHORT[1]
    time = after.time[0] + slower * (after.time - after.time[0])
    other = Record(time, after.displacement, after.force)
    assert len(read_logs(_put(tmp_path, export([SHORT[0], other])))) == n_tests


def test_another_setting_is_another_test(tmp_path) -> None:
    text = export(SHORT)
    head, *rest = text.split("Running Time")
    said = [
        f"# setting: {1 if i < 4 else 2}\r\nRunning Time{block}" for i, block in enumerate(rest)
    ]
    parts = read_logs(_put(tmp_path, head + "".join(said)))
    assert [(part.setting, len(part.time)) for part in parts] == [(1, 128), (2, 128)]


def test_a_block_without_its_end_is_a_gap(tmp_path) -> None:
    cut = SHORT[2].rows(0, 20)
    parts = read_logs(_put(tmp_path, export([*SHORT[:2], cut, *SHORT[3:]])))
    assert [len(part.time) for part in parts] == [84, 160]
    assert "0.0127 s later than the block before ends" in _joined_note(parts[0])


def test_a_block_cut_within_a_row_is_refused_with_its_line_or_dropped(tmp_path) -> None:
    lines = export(SHORT).split("\r\n")
    at = lines.index("", 2) - 1  # last row of the first block
    lines[at] = lines[at].rpartition("\t")[0]
    path = _put(tmp_path, "\r\n".join(lines))
    with pytest.raises(LogError, match=rf"line {at + 1}: found 2 fields, expected 3.*bad_rows"):
        read_logs(path)
    (joined,) = [read_logs(path, ReadOptions(bad_rows="drop"))]
    assert [len(part.time) for part in joined] == [31, 224]
    assert [one.name for part in joined for one in part.findings] == ["rows_dropped"]


def test_a_file_cut_within_a_block_keeps_the_others(tmp_path) -> None:
    text = export(SHORT)
    last = text.rindex("Data Acquisition")
    in_rows = read_log(_put(tmp_path, text[: last + 300]))
    assert 224 < len(in_rows.time) < 256
    assert [one.name for one in in_rows.findings] == ["cut_row"]
    in_names = read_log(_put(tmp_path, text[: last + 100]))
    assert len(in_names.time) == 224
    assert any(note.startswith("left out: the block in line ") for note in in_names.notes)


def test_a_block_without_rows_in_the_middle_is_left_out(tmp_path) -> None:
    empty = SHORT[0].rows(0, 0)
    found = read_log(_put(tmp_path, export([*SHORT[:3], empty, *SHORT[3:], empty])))
    assert len(found.time) == 256
    assert any(", without rows" in note and " and 1 more" in note for note in found.notes)


def test_a_damaged_temperature_of_one_block_leaves_it_out_of_the_record(tmp_path) -> None:
    text = export(SHORT[:3]).replace("Axial Force\r\nSec\tmm\tkN", "Temperature\r\nSec\tmm\tdegC")
    text = text.replace("Axial Displacement", "Axial Displacement\tAxial Force")
    text = text.replace("Sec\tmm", "Sec\tmm\tkN").replace("\r\n0.0", "\r\n0.0").split("\r\n")
    rows = [f"{line}\t26" if line[:2] == "0." else line for line in text]
    whole = read_log(_put(tmp_path, "\r\n".join(rows)))
    assert whole.temperature is not None
    assert len(whole.temperature) == 96
    rows[rows.index("", 2) - 1] = rows[rows.index("", 2) - 1].rpartition("\t")[0] + "\tnan"
    found = read_log(_put(tmp_path, "\r\n".join(rows)))
    assert found.temperature is None
    assert any(note.startswith("temperature: left out; 1 of 32") for note in found.notes)
