"""Whatever is killed, the next run finishes, and the table is that of an undisturbed one."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.fleet.conftest import put

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self").exists(), reason="workers are found in /proc"),
]
N_DAMPERS = 8


@pytest.fixture(scope="module")
def logs(tmp_path_factory, texts):
    folder = tmp_path_factory.mktemp("killed") / "logs"
    for k in range(N_DAMPERS):
        put(folder / f"D{k}", texts)
    return folder


@pytest.fixture(scope="module")
def undisturbed(logs):
    return finished(logs, logs.parent / "undisturbed")


def command(logs: Path, out: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "damperfit", "fleet", str(logs), "--out", str(out), *more]


def finished(logs: Path, out: Path, *more: str) -> list[bytes]:
    subprocess.run(command(logs, out, "--collect", *more), check=True, capture_output=True)
    return [(out / "_fleet" / f"fleet.{kind}").read_bytes() for kind in ("parquet", "csv")]


def wait_for_part(out: Path, running: subprocess.Popen, number: int = 1) -> None:
    until = time.monotonic() + 120.0
    while len(list(out.glob("serial-*/part-*.parquet"))) < number:
        assert running.poll() is None
        assert time.monotonic() < until
        time.sleep(0.02)


def test_workers_and_order_make_no_difference(logs, undisturbed, tmp_path):
    names = sorted(str(path) for path in logs.rglob("*.csv"))
    random.Random(1).shuffle(names)  # noqa: S311
    for jobs in ("1", "4"):
        assert finished(logs, tmp_path / jobs, "--jobs", jobs) == undisturbed
    out = tmp_path / "shuffled"
    shuffled = [sys.executable, "-m", "damperfit", "fleet", *names, "--out", str(out), "--collect"]
    subprocess.run(shuffled, check=True, capture_output=True)
    assert (out / "_fleet" / "fleet.parquet").read_bytes() == undisturbed[0]


def test_two_runs_at_once_into_one_folder(logs, undisturbed, tmp_path):
    out = tmp_path / "out"
    both = [subprocess.Popen(command(logs, out), stderr=subprocess.PIPE) for _ in range(2)]
    for one in both:
        one.communicate()
        assert one.returncode == 0
    assert finished(logs, out) == undisturbed


def test_an_interrupt_ends_cleanly(logs, undisturbed, tmp_path):
    out = tmp_path / "out"
    running = subprocess.Popen(
        command(logs, out, "--jobs", "1"), stderr=subprocess.PIPE, start_new_session=True
    )
    wait_for_part(out, running, 2)
    os.killpg(running.pid, signal.SIGINT)
    _, said = running.communicate(timeout=60.0)
    assert running.returncode == 130
    assert b"the same command goes on with them" in said
    assert b"Traceback" not in said
    assert finished(logs, out) == undisturbed


@pytest.mark.extras
def test_a_dask_cluster_gives_the_same_table_also_when_a_worker_is_killed(
    logs, undisturbed, tmp_path
):
    import distributed

    out = tmp_path / "out"
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster:
        address = cluster.scheduler_address
        running = subprocess.Popen(command(logs, out, "--scheduler", address))
        wait_for_part(out, running)
        pids = [worker.pid for worker in cluster.workers.values()]
        os.kill(pids[0], signal.SIGKILL)
        assert running.wait(timeout=300.0) == 0
    assert finished(logs, out) == undisturbed
