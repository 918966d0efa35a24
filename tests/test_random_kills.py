"""Runs killed at random instants lose and mix nothing: 30 of `identify`, 30 of `fleet`.

pytest -m slow tests/test_random_kills.py        # some minutes; DAMPERFIT_KILLS=300 for more
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import damperfit
from tests.fleet.conftest import SAMPLES, put, texts  # noqa: F401 - a fixture

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="groups of processes, and /proc"),
]
KILLS = int(os.environ.get("DAMPERFIT_KILLS", "30"))
PROGRAM = "import sys; from damperfit.__main__ import main; sys.exit(main())"


def started(*words: object) -> subprocess.Popen:
    command = [sys.executable, "-P", "-c", PROGRAM, *map(str, words), "--quiet"]
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def seconds(*words: object) -> float:
    begun = time.monotonic()
    assert started(*words).wait(300.0) == 0
    return time.monotonic() - begun


def killed(process: subprocess.Popen, after: float) -> bool:
    """Kill a run with all its processes; return whether it was still at work."""
    try:
        process.wait(after)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait(30.0)
        return True
    return False


def test_identify_leaves_the_old_set_or_the_new_one_whole(tmp_path: Path) -> None:
    """Sets of other settings, one over the other; which set it is, and whether it is whole."""
    instants = random.Random(4)  # noqa: S311
    sets = [[SAMPLES / f"setting_{k:02d}.csv" for k in ks] for ks in ((1, 2), (2, 3, 4))]
    labels = [{"1", "2"}, {"2", "3", "4"}]
    out = tmp_path / "out"
    whole = seconds("identify", *sets[0], "--out", out)
    n_killed = n_new = 0
    for k in range(KILLS):
        before = {one.label for one in damperfit.load(out).settings}
        new = 1 if before == labels[0] else 0
        process = started("identify", *sets[new], "--out", out, "--jobs", 1 + k % 2)
        # Half of them about the end, where the files are exchanged.
        low = 0.6 if k % 2 else 0.0
        n_killed += killed(process, instants.uniform(low * whole, 1.2 * whole))
        run = damperfit.load(out)
        assert {one.label for one in run.settings} in labels
        n_new += {one.label for one in run.settings} == labels[new]
        record = json.loads((out / "run.json").read_text())
        assert record["files"]
        for name, digest in record["files"].items():
            assert hashlib.sha256((out / name).read_bytes()).hexdigest() == digest, name
        assert run.remarks == ()
    print(f"{n_killed} of {KILLS} killed at work, {n_new} with the new set")
    assert n_killed > KILLS // 3
    assert started("identify", *sets[0], "--out", out).wait(300.0) == 0
    assert not [path.name for path in out.iterdir() if path.name.startswith(".")]


def workers_of(pid: int) -> list[int]:
    """Return the processes that a run has spawned."""
    children = Path(f"/proc/{pid}/task").glob("*/children")
    pids = [int(one) for path in children for one in path.read_text().split()]
    return [
        one
        for one in pids
        if b"damperfit.workers import serve" in Path(f"/proc/{one}/cmdline").read_bytes()
    ]


def test_fleet_goes_on_to_the_table_of_an_undisturbed_one(tmp_path: Path, texts) -> None:  # noqa: F811
    instants = random.Random(5)  # noqa: S311
    for k in range(4):
        put(tmp_path / "logs" / f"D{k}", texts)
    logs, quiet = tmp_path / "logs", tmp_path / "quiet"
    whole = seconds("fleet", logs, "--out", quiet, "--jobs", 2, "--collect")
    names = ("_fleet/fleet.parquet", "_fleet/fleet.csv")
    expected = [(quiet / name).read_bytes() for name in names]
    n_killed = 0
    for k in range(KILLS):
        out = tmp_path / f"out_{k // 3}"  # three kills, one after the other, then to the end
        process = started("fleet", logs, "--out", out, "--jobs", 2, "--collect")
        after = instants.uniform(0.0, whole)
        if k % 3 == 2:  # a worker alone: another one goes on
            time.sleep(after)
            workers = workers_of(process.pid) if process.poll() is None else []
            for pid in workers[:1]:
                os.kill(pid, signal.SIGKILL)
            n_killed += bool(workers)
            assert process.wait(300.0) == 0
            assert [(out / name).read_bytes() for name in names] == expected
            assert not list(out.rglob(".damperfit-*"))
        else:
            n_killed += killed(process, after)
            assert len(list(out.glob("serial-*/part-*.parquet"))) <= 4
    print(f"{n_killed} of {KILLS} killed at work")
    assert n_killed > KILLS // 3
