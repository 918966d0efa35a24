"""A fleet of small logs that `samples` made, and what `damperfit fleet` takes for it.

    python -m tests.fleet.many_dampers FOLDER --dampers 1000          # 20 000 logs, and their fit
    python -m tests.fleet.many_dampers FOLDER --dampers 25 --only-make

A damper is one of `KINDS` dampers whose valves differ by a few per cent, with noise of its own, a
serial number and a date. What is there is not made again. Linux only: memory is read off /proc.
"""

import argparse
import os
import resource
import subprocess
import sys
import time
from datetime import date, timedelta
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import damperfit.synthetic as sample_logs
from damperfit.damper.purdy.parameters import reference_parameters
from damperfit.synthetic import SampleOptions, make_samples
from damperfit.workers import Processes

ROOT = Path(__file__).parents[2]
KINDS = 5  # a settled cycle costs 0.8 s, noise on it 0.01 s


class Use(NamedTuple):
    """What a run took."""

    code: int
    command_mb: float
    processor_s: float
    seconds: float

    def told(self, n_logs: int) -> str:
        return (
            f"{n_logs} logs: code {self.code}, {self.seconds:.0f} s by the clock, "
            f"{1000.0 * self.processor_s / n_logs:.0f} ms of processor a log, "
            f"{self.command_mb:.0f} MB for the command itself"
        )


def make_damper(number: int, folder: Path, settings: tuple[int, ...], cycles: float) -> int:
    """Write the logs of one damper, unless they are there."""
    own = folder / f"SN{number:05d}"
    done = own / ".made"
    if done.exists():
        return number
    if not hasattr(sample_logs.steady_cycle, "cache_info"):
        sample_logs.steady_cycle = lru_cache(maxsize=None)(sample_logs.steady_cycle)
    share = 1.0 + 0.01 * (number % KINDS - KINDS // 2)
    parameters = {}
    for setting in settings:
        true = reference_parameters(setting)
        parameters[setting] = true.replace({"r_m1": share * true.r_m1, "r_m2": share * true.r_m2})
    options = SampleOptions(settings=settings, cycles=cycles, seed=2000 + number)
    day = date(2026, 1, 1) + timedelta(days=number % 200)
    said = f"# serial: SN{number:05d}\n# date: {day.isoformat()}\n"
    for path in make_samples(own, options, parameters=parameters):
        path.write_text(said + path.read_text())
    for name in ("README.md", "truth.csv"):
        (own / name).unlink()
    done.touch()
    return number


def measure(*arguments: str) -> Use:
    """Run `damperfit` and watch the memory of the command, its workers aside."""
    begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    process = subprocess.Popen(
        [sys.executable, "-m", "damperfit", *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
    )
    peak = 0
    while process.poll() is None:
        try:
            status = Path(f"/proc/{process.pid}/status").read_text()
        except OSError:  # it has just ended
            break
        if "VmHWM:" in status:
            peak = int(status.partition("VmHWM:")[2].split()[0])
        time.sleep(0.1)
    code = process.wait()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Use(code, peak / 1024, spent, time.perf_counter() - begin)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--dampers", type=int, default=1000)
    parser.add_argument("--settings", type=int, default=20, help="logs of each damper, up to 20")
    parser.add_argument("--cycles", type=float, default=5.0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only-make", action="store_true")
    chosen = parser.parse_args()
    settings = tuple(range(1, chosen.settings + 1))
    logs = chosen.folder / "logs"
    act = partial(make_damper, folder=logs, settings=settings, cycles=chosen.cycles)
    for number, found in Processes(chosen.jobs).each(act, range(chosen.dampers)):
        if isinstance(found, Exception) or found != number:
            raise SystemExit(f"damper {number}: {found!r}")
    n_logs = chosen.dampers * chosen.settings
    print(f"{n_logs} logs in {logs}", flush=True)
    if not chosen.only_make:
        out = str(chosen.folder / "fleet")
        for _ in range(2):  # the second one finds everything done
            found = measure("fleet", str(logs), "--out", out, "--jobs", str(chosen.jobs), "-q")
            print(found.told(n_logs), flush=True)
        found = measure("fleet", "--out", out, "--collect", "--report", "-q")
        print("one table and the page, as many logs again:", found.told(n_logs), flush=True)


if __name__ == "__main__":
    main()
