"""Processor time, clock and memory of `identify` over 200 logs, beyond the bare imports.

    python -m tests.benchmarks.two_hundred DIR                  # 200 logs of 10 s at 1 kHz

The logs are of as many settings, whose parameters lie evenly between those of the reference set, so
that no two are the same test. They are made in DIR where it holds none. Python keeps its bytecode
in DIR, as it does beside an installed program, whatever the environment says. Linux and macOS.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from damperfit.damper.purdy.parameters import REFERENCE_SETTINGS, reference_parameters

ROOT = Path(__file__).parents[2]
IMPORTS = "import numpy, scipy.signal, scipy.optimize, pandas, pyarrow, typer, rich"
NAMES = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")


def make_logs(folder: Path, n_logs: int) -> str:
    """Make the logs of that many settings where there are none; return their pattern."""
    logs = folder / f"logs_{n_logs}"
    if not logs.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        places = np.linspace(REFERENCE_SETTINGS[0], REFERENCE_SETTINGS[-2], n_logs)
        known = [reference_parameters(setting) for setting in REFERENCE_SETTINGS]
        rows = [
            [
                np.interp(at, REFERENCE_SETTINGS, [getattr(one, name) for one in known])
                for at in places
            ]
            for name in NAMES
        ]
        lines = [f"{k + 1}," + ",".join(f"{row[k]:.6g}" for row in rows) for k in range(n_logs)]
        table = folder / f"parameters_{n_logs}.csv"
        table.write_text("\n".join([",".join(("setting", *NAMES)), *lines]) + "\n")
        made = f"--parameters {table} --settings 1-{n_logs} --sample-rate 1000Hz --cycles 15"
        _seconds("-m", "damperfit", "samples", str(logs), *made.split(), "--quiet")
    return str(logs / "setting_*.csv")


def _seconds(*arguments: str) -> tuple[float, float]:
    """Return the processor time of a Python process, its children's included, and the clock's."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    after, spent = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - begin
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, spent


def _tell_memory(paths: list[str], results: Path) -> None:
    """Tell what another log takes of the command's largest memory: by all logs and by half."""
    peaks = []
    for few in (paths[: len(paths) // 2], paths):
        script = (
            "import resource, subprocess, sys\n"
            "subprocess.run([sys.executable, '-m', 'damperfit', *sys.argv[1:]], check=True,\n"
            "               stdout=subprocess.DEVNULL)\n"
            "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)\n"
        )
        command = [sys.executable, "-c", script, "identify", *few, "--out", str(results), "--quiet"]
        said = subprocess.run(command, check=True, cwd=ROOT, capture_output=True, text=True)
        peaks.append(int(said.stdout) / 1024)
    more = (peaks[1] - peaks[0]) / (len(paths) - len(paths) // 2)
    print(f"peak memory {peaks[1]:.0f} MB, of half the logs {peaks[0]:.0f}: {more:.2f} MB a log")


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    chosen = parser.parse_args()
    folder = chosen.folder.resolve()
    # Let every Python from here on load what one before has compiled.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
    pattern, results = make_logs(folder, chosen.logs), folder / "results"
    command = ["identify", pattern, "--out", str(results), "--quiet"]
    for round_ in range(1 + chosen.rounds):
        bare, waited = _seconds("-c", IMPORTS)
        ours, clock = _seconds("-m", "damperfit", *command)
        if round_ == 0:  # everything is compiled now
            continue
        record = json.loads((results / "run.json").read_text(encoding="utf-8"))
        laps = {name: round(1e3 * s / chosen.logs, 1) for name, s in record["timings"].items()}
        print(
            f"{chosen.logs} logs: {ours:.2f} s of processor, bare import {bare:.2f} s, "
            f"{1e3 * (ours - bare) / chosen.logs:.1f} ms a log beyond it, by the clock "
            f"{1e3 * (clock - waited) / chosen.logs:.1f}: {laps}; "
            f"{len(record['failures'])} failures"
        )
    logs = Path(pattern)
    _tell_memory(sorted(map(str, logs.parent.glob(logs.name))), results)


if __name__ == "__main__":
    main()
