"""MTS blocks that tell time in their titles alone."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_logs
from tests.io.mts_files import BUFFER, RATE, blocks_of, record

STEP = BUFFER / RATE
NAMES = "Axial Displacement\tAxial Force"


def export(blocks, times, *, decimal=".", names=NAMES, last_row=""):
    """The file, each block headed by a title with its time."""
    lines = [f"MTS793|MPT|ENU|1|2|{decimal}|/|:|1|0|0|A", ""]
    for block, time in zip(blocks, times, strict=True):
        lines += [f"Data Acquisition: Timed\t\tTime:\t{time:.6f}\tSec\t3/29/2016 1:54:32 PM"]
        lines += [names, "mm\tkN"]
        lines += [f"{x:.9f}\t{f:.9f}" for x, f in zip(block.displacement, block.force, strict=True)]
        lines += [last_row] if last_row and block is blocks[-1] else []
        lines.append("")
    return "\r\n".join(lines).replace(".", decimal)


@pytest.fixture
def put(tmp_path):
    """Write a file and return its path."""

    def write(text, name):
        path = tmp_path / name
        path.write_text(text, newline="")
        return path

    return write


def full(n):
    return blocks_of(record(n * STEP))[:n]


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("n_last", [BUFFER, 300])
@pytest.mark.parametrize("is_stamped_at_the_end", [True, False])
def test_blocks_that_follow_at_a_steady_rate_are_one_record(
    put, decimal, n_last, is_stamped_at_the_end
) -> None:
    blocks = full(6)
    blocks[-1] = blocks[-1].rows(0, n_last)
    begins = np.array([block.time[0] for block in blocks])
    lasts = np.array([len(block.time) for block in blocks]) / RATE
    times = 12.5 + begins + (lasts if is_stamped_at_the_end else 0.0)
    (log,) = read_logs(put(export(blocks, times, decimal=decimal), "setting_03.dat"))
    whole = record(6 * STEP)
    n = 5 * BUFFER + n_last
    assert len(log.time) == n
    assert log.time == pytest.approx(np.arange(n) / RATE, rel=1e-6)
    assert log.displacement == pytest.approx(whole.displacement[:n] / 1e3, abs=1e-11)
    assert log.force == pytest.approx(whole.force[:n] * 1e3, abs=1e-5)
    assert "6 blocks joined; time: 1024 Hz, by the times in their titles" in log.notes


@pytest.mark.parametrize(("n", "is_read"), [(2, False), (3, True)])
def test_three_titles_tell_a_rate(put, n, is_read) -> None:
    path = put(export(full(n), 1.0 + STEP * np.arange(n)), "setting_03.dat")
    if is_read:
        assert len(read_logs(path)) == 1
        return
    with pytest.raises(LogError, match=r"only the titles of its blocks give a time, and no steady"):
        read_logs(path)
    # As the sentence says.
    assert len(read_logs(path, ReadOptions(sample_rate=RATE))) == n


@pytest.mark.parametrize(("off", "is_read"), [(0.0096, True), (0.0104, False)])
def test_steps_from_title_to_title_are_alike_within_one_percent(put, off, is_read) -> None:
    steps = STEP * np.array([0.0, 1.0, 1.0, 1.0 + off, 1.0])
    path = put(export(full(5), 1.0 + np.cumsum(steps)), "setting_03.dat")
    if is_read:
        assert len(read_logs(path)) == 1
        return
    with pytest.raises(LogError, match="no column for time"):
        read_logs(path)


def test_blocks_of_different_lengths_are_no_record(put) -> None:
    blocks = full(4)
    blocks[1] = blocks[1].rows(0, 500)
    with pytest.raises(LogError, match="no column for time"):
        read_logs(put(export(blocks, STEP * np.arange(4)), "setting_03.dat"))


@pytest.mark.parametrize("times", [[4.0, 4.0, 4.0], [4.0, 3.0, 2.0]])
def test_titles_that_stand_or_go_back_tell_no_rate(put, times) -> None:
    with pytest.raises(LogError, match="no column for time"):
        read_logs(put(export(full(3), times), "setting_03.dat"))


def test_a_bad_row_is_told_by_its_line(put) -> None:
    blocks = full(3)
    blocks[2] = blocks[2].rows(0, 500)
    text = export(blocks, STEP * np.arange(3), last_row="1.0\tnan")
    line = 2 + 2 * (3 + BUFFER + 1) + 3 + 500 + 1
    with pytest.raises(LogError, match=rf"line {line}\b"):
        read_logs(put(text, "setting_03.dat"))
