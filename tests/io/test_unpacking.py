"""Logs packed by gzip or inside MATLAB files: limits, damage, and work that grows with size."""

from __future__ import annotations

import gzip
import io

import numpy as np
import pytest
from scipy import io as scipy_io

from damperfit.errors import LogError
from damperfit.io import ReadOptions, read_log

ROWS = b"time_s,displacement_mm,force_N\n" + b"".join(b"%d,%d,%d\n" % (i, i, i) for i in range(400))


@pytest.fixture
def log(tmp_path):
    def write(packed: bytes, name: str = "log_s3.csv.gz"):
        path = tmp_path / name
        path.write_bytes(packed)
        return path

    return write


def members(*parts: bytes) -> bytes:
    return b"".join(map(gzip.compress, parts))


@pytest.mark.parametrize(
    "packed",
    [members(ROWS), members(ROWS[:700], ROWS[700:]), members(ROWS, b""), members(b"", ROWS)],
    ids=["one member", "two members", "empty at the end", "empty at the start"],
)
def test_the_limit_counts_what_is_unpacked_of_all_members(log, packed) -> None:
    path = log(packed)
    assert len(read_log(path, ReadOptions(max_bytes=len(ROWS))).force) == 400
    with pytest.raises(LogError, match=f"more than the limit of {len(ROWS) - 1} bytes .*max_log"):
        read_log(path, ReadOptions(max_bytes=len(ROWS) - 1))


def test_a_huge_limit_costs_nothing_by_itself(log) -> None:
    assert len(read_log(log(members(ROWS)), ReadOptions(max_bytes=1 << 60)).force) == 400


def test_zeros_fill_up_the_end_of_a_tape(log) -> None:
    assert len(read_log(log(members(ROWS) + bytes(5000))).force) == 400


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda packed: packed[:-1], "truncated gzip; the end of the file is missing"),
        (lambda packed: packed[:-8], "truncated gzip; the end of the file is missing"),
        (lambda packed: packed[:-9], "truncated gzip; the end of the file is missing"),
        (lambda packed: packed[:3], "truncated gzip; the end of the file is missing"),
        (lambda packed: packed + packed[:12], "truncated gzip; the end of the file is missing"),
        (lambda packed: packed[:2] + b"\x07" + packed[3:], "damaged gzip: Unknown compression"),
        (lambda packed: packed[:60] + b"\xff\xff" + packed[62:], "damaged gzip: "),
        (lambda packed: packed[:-8] + bytes(4) + packed[-4:], "damaged gzip: CRC check failed"),
        (lambda packed: packed[:-4] + bytes(4), "damaged gzip: Incorrect length"),
        (lambda packed: packed + b"more", "damaged gzip: odd bytes at its end; copy the log again"),
        (lambda packed: packed + b"\0m", "damaged gzip: odd bytes at its end; copy the log again"),
    ],
)
def test_damage_is_one_sentence(log, damage, says) -> None:
    with pytest.raises(LogError, match=f"^log_s3.csv.gz: {says}") as caught:
        read_log(log(damage(members(ROWS))))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "n",
    [
        *(131_064, 131_065, 131_066, 262_144),
        *(pytest.param(n, marks=pytest.mark.slow) for n in (393_216, 1_000_000)),
    ],
)
def test_what_packs_a_thousandfold_is_read_to_its_end(log, n) -> None:
    # zlib may have taken the last packed byte long before it gives the last unpacked one.
    sink = io.BytesIO()
    time = np.arange(n, dtype=np.float64)[:, None]
    variables = {"time_s": time, "displacement_mm": 0.0 * time, "force_N": 0.0 * time}
    scipy_io.savemat(sink, variables, do_compression=True)
    assert len(read_log(log(sink.getvalue(), "a_s1.mat")).force) == n


@pytest.mark.parametrize("is_packed", [True, False])
def test_the_values_of_a_matlab_file_are_counted_before_they_are_read(log, is_packed) -> None:
    sink = io.BytesIO()
    column = np.zeros((100_000, 1))
    names = ("time_s", "displacement_mm", "force_N")
    scipy_io.savemat(sink, dict.fromkeys(names, column), do_compression=is_packed)
    path = log(sink.getvalue(), "a_s1.mat")
    with pytest.raises(LogError, match=r"more than the limit of 2399999 .*rig.max_log_bytes"):
        read_log(path, ReadOptions(max_bytes=max(2_399_999, path.stat().st_size * is_packed)))
