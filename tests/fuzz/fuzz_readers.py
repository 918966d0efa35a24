"""Damaged logs against every reader: a recording or one LogError, in bounded time and memory.

    python -m tests.fuzz.fuzz_readers --runs 100000            # each format in turn
    python -m tests.fuzz.fuzz_readers --format TDMS --seed 7

What breaks the promise is kept in the folder --keep, and the command ends with code 1.
"""

import argparse
import importlib.util
import os
import random
import resource
import sys
import tempfile
import time
import zlib
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from damperfit.errors import LogError
from damperfit.io import ReadOptions, child_process, read_curves, read_logs
from tests.io import binary_logs, scenarios

SCENARIO = scenarios.Scenario()
MAX_SECONDS = 5.0  # of the processor; children count
MAX_GROWTH = 300_000_000  # bytes beyond what reading the undamaged log took
OPTIONS = (
    ReadOptions(max_bytes=20_000_000),
    ReadOptions(
        max_bytes=20_000_000, bad_rows="drop", restarts="split", allow_truncated=True, pause=1.0
    ),
)
APART = ("MDF", "MATLAB 7.3")  # a process for each log that is refused: a hundredth of the runs
CURVES = (
    "(25-4.3) V-C,C,V-R,R,(12-4.3) V-C,C,V-R,R\nmm/s,N,mm/s,N,mm/s,N,mm/s,N\n"
    "50,100,50,200,50,80,50,150\n100,180,100,420,100,150,100,330\n200,300,200,900,,,200,700\n"
)  # no log: it has no time
TOKENS = (
    b"nan", b"inf", b"1e400", b"-", b",", b";", b"\t", b'"', b"\r", b"\n", b"\0", b"#", b"\xb5",
    b"# setting: ", b"Data Acquisition", b"MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A", b"Header Size: 7",
    b"\xff\xfe", b"\xef\xbb\xbf", b"12:00:00 PM", b"2022-02-30", b"(mm)", b"time_s", b"force_N",
    b"[", b"]", b"{", b"}", b":", b"null", b"(3) V-R", b"-0.1",
    b"\xff\xff\xff\xff\xff\xff\xff\xff", b"\x00\x00\x00\x80", b"1,5", b"0x10", b"1_000",
)  # fmt: skip


class PromiseBroken(AssertionError):  # noqa: N818  # what it says
    """A reader let something else out, took too long or too much."""


@cache
def seeds() -> dict[str, tuple[str, bytes]]:
    """Return format -> file name and bytes of a good log."""
    found = {name: (file, write(SCENARIO)) for name, (file, write) in scenarios.WRITERS.items()}
    found["curves"] = ("curves.csv", CURVES.encode())
    for name, (file, write, needed) in binary_logs.WRITERS.items():
        if all(importlib.util.find_spec(module) for module in needed):
            found[name] = (file, write(SCENARIO))
    return found


def memory() -> int:
    """Return the most memory this process has had, in bytes; Linux."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def busy() -> float:
    """Return the seconds that this process and its children have computed for."""
    living = 0
    for child in child_process._CHILDREN._idle:  # os.times() counts those that have ended
        with suppress(OSError):
            stat = Path(f"/proc/{child._process.pid}/stat").read_text(encoding="ascii")
            living += sum(map(int, stat.rpartition(")")[2].split()[11:13]))
    return sum(os.times()[:4]) + living / os.sysconf("SC_CLK_TCK")


@dataclass
class Tally:
    """What came of the runs."""

    read: int = 0
    refused: int = 0
    slowest: float = 0.0
    start_memory: int = field(default_factory=memory)

    def __str__(self) -> str:
        growth = (memory() - self.start_memory) / 1e6
        return (
            f"{self.read} read, {self.refused} refused, slowest {self.slowest:.3f} s, "
            f"memory grew {growth:.0f} MB"
        )


def attempt(data: bytes, path: Path, tally: Tally) -> None:
    """Read bytes as a log."""
    path.write_bytes(data)
    options = OPTIONS[zlib.crc32(data) % len(OPTIONS)]
    begin = busy()
    try:
        if path.name.startswith("curves"):
            found = [(one.velocity, one.force) for one in read_curves(path, options)]
        else:
            logs = read_logs(path, options)
            found = [(one.time, one.displacement, one.force) for one in logs]
    except LogError as error:
        tally.refused += 1
        message = str(error)
        if len(message.splitlines()) != 1 or not message.isprintable():
            raise PromiseBroken(f"no single printable line: {message!r}") from error
    except Exception as error:
        raise PromiseBroken(f"{type(error).__name__}: {error}") from error
    else:
        tally.read += 1
        for first, *others in found:
            if not all(
                np.isfinite(one).all() and len(one) == len(first) for one in (first, *others)
            ):
                raise PromiseBroken("a channel that is not finite, or of another length")
            if len(others) > 1 and not np.all(np.diff(first) > 0.0):
                raise PromiseBroken("time that does not increase")
    took = busy() - begin
    tally.slowest = max(tally.slowest, took)
    if took > MAX_SECONDS:
        raise PromiseBroken(f"took {took:.1f} s")
    if memory() - tally.start_memory > MAX_GROWTH:
        raise PromiseBroken("memory grew beyond the limit")


def damaged(data: bytes, others: list[bytes], dice: random.Random) -> bytes:
    """Return bytes with one to eight wounds."""
    wounded = bytearray(data)
    for _ in range(dice.choice((1, 1, 1, 2, 4, 8))):
        at = dice.randrange(len(wounded) + 1)
        kind = dice.randrange(8)
        if kind == 0:
            del wounded[at:]
        elif kind == 1:
            del wounded[at : at + dice.randrange(1, 40)]
        elif kind == 2:
            wounded[at:at] = dice.choice(TOKENS)
        elif kind == 3:
            part = wounded[at : at + dice.randrange(1, 200)]
            wounded[at:at] = bytes(part) * dice.choice((1, 1, 50))
        elif kind == 4:
            other = dice.choice(others)
            start = dice.randrange(len(other) + 1)
            wounded[at:at] = other[start : start + dice.randrange(1, 200)]
        elif at < len(wounded):
            wounded[at] = dice.choice((0, 1, 255, wounded[at] ^ 1 << dice.randrange(8)))
    return bytes(wounded)


def fuzz(name: str, *, runs: int, seed: int, folder: Path, keep: Path) -> Tally:
    """Read that many damaged logs of a format."""
    logs = seeds()
    file, data = logs[name]
    others = [other for _, other in logs.values()]
    dice = random.Random(f"{name} {seed}")  # noqa: S311  # the same for the same seed
    path = folder / file
    attempt(data, path, Tally())
    tally = Tally()
    for _ in range(runs):
        wounded = damaged(data, others, dice)
        try:
            attempt(wounded, path, tally)
        except PromiseBroken as error:
            keep.mkdir(parents=True, exist_ok=True)
            kept = keep / f"{time.time_ns()}_{path.name}"
            kept.write_bytes(wounded)
            raise PromiseBroken(f"{error} (kept as {kept})") from error
    return tally


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Damaged logs against every reader.")
    parser.add_argument("--format", choices=sorted(seeds()), action="append")
    parser.add_argument("--runs", type=int, default=20_000, help="for each format")
    parser.add_argument("--seed", type=int, default=time.time_ns())
    parser.add_argument("--keep", type=Path, default=Path("fuzz_findings"))
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in chosen.format or seeds():
            runs = max(1, chosen.runs // (100 if name in APART else 1))
            try:
                tally = fuzz(
                    name, runs=runs, seed=chosen.seed, folder=Path(folder), keep=chosen.keep
                )
            except PromiseBroken as error:
                print(f"{name}: {error}")
                return 1
            print(f"{name}: {tally}", flush=True)
    return 0


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.exit(main())
