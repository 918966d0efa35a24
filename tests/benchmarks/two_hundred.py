"""Processor time, clock and memory of `identify` over 200 logs, beyond the bare imports.

    python -m tests.benchmarks.two_hundred DIR                  # 200 logs of 10 s at 1 kHz
    python -m tests.benchmarks.two_hundred DIR --logs 20 --profile
    python -m tests.benchmarks.two_hundred DIR --logs 40 --reading  # reading, conditioning alone
    python -m tests.benchmarks.two_hundred DIR --judging            # judging, writing alone

The logs are of as many settings, whose parameters lie evenly between those of the reference set, so
that no two are the same test. They are made in DIR where it holds none. With ``--profile`` what the
time goes into is told function by function, and each stage in ms a log. Python keeps its bytecode
in DIR, as it does beside an installed program, whatever the environment says. Linux and macOS.
"""

import argparse
import cProfile
import json
import os
import pstats
import resource
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

from damperfit.damper.purdy.reference import REFERENCE_SETTINGS, reference_parameters

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
        _damperfit(
            *("samples", str(logs), "--parameters", str(table), "--settings", f"1-{n_logs}"),
            *("--sample-rate", "1000Hz", "--cycles", "15", "--quiet"),
        )
    return str(logs / "setting_*.csv")


def _damperfit(*arguments: str) -> None:
    _seconds("-m", "damperfit", *arguments)


def _keep_bytecode(folder: Path) -> None:
    """Let every Python from here on load what one before has compiled."""
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")


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


def _profile(arguments: list[str]) -> None:
    """Run the command here, one job, and tell where the time goes."""
    from damperfit.cli.main import main as run

    sys.argv = ["damperfit", *arguments, "--jobs", "1"]
    watch = cProfile.Profile(time.process_time)
    with suppress(SystemExit):
        watch.runcall(run)
    told = pstats.Stats(watch)
    told.sort_stats("tottime").print_stats(45)
    told.sort_stats("cumtime").print_stats(120)


def _tell_reading(pattern: str, rounds: int) -> None:
    """Tell what reading and conditioning, findings included, take of a log once all is loaded."""
    from damperfit.conditioning import condition
    from damperfit.configuration.loading import load_configuration
    from damperfit.io import read_log

    configuration = load_configuration()
    paths = sorted(Path(pattern).parent.glob(Path(pattern).name))
    for _ in range(1 + rounds):  # the first warms up
        spent = []
        for path in paths:
            begin = time.process_time()
            log = read_log(path, configuration.reading)
            between = time.process_time()
            condition(log, configuration.conditioning)
            spent.append((between - begin, time.process_time() - between))
        read, conditioned = 1e3 * np.median(spent, axis=0)
    print(f"ms of processor a log, medians: reading {read:.2f}, conditioning {conditioned:.2f}")


def _tell_judging(pattern: str, results: Path, rounds: int) -> None:
    """Tell what judging the fits and writing the results take of a log once all is loaded."""
    from damperfit.configuration.loading import load_configuration
    from damperfit.run import identify

    configuration = load_configuration(overlay={"output": {"folder": str(results)}})
    spent = []
    for _ in range(1 + rounds):  # the first warms up; each anew, for logs and fits keep things
        (found,) = identify.identified(configuration, [pattern], jobs=1)
        begin = time.process_time()
        found.run.save(found.folder)
        laps = found.run.record["timings"]
        written = time.process_time() - begin
        times = (laps["judge_s"], laps["characteristics_s"], written)
        spent.append([1e3 * one / len(found.run.settings) for one in times])
        if found.failures:
            raise SystemExit(f"a setting was not judged: {found.failures[0].message}")
    judge_ms, read_ms, write_ms = np.median(spent[1:], axis=0)
    print(
        f"ms a log, medians of {rounds}: judging {judge_ms:.2f} and characteristics {read_ms:.2f} "
        f"by the clock, writing {write_ms:.2f} of processor"
    )


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Processor time of identify over many logs.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--profile", action="store_true")
    parser.add_argument("--reading", action="store_true")
    parser.add_argument("--judging", action="store_true")
    chosen = parser.parse_args()
    _keep_bytecode(chosen.folder.resolve())
    pattern = make_logs(chosen.folder.resolve(), chosen.logs)
    if chosen.reading:
        _tell_reading(pattern, chosen.rounds)
        return
    results = chosen.folder.resolve() / "results"
    if chosen.judging:
        _tell_judging(pattern, results, chosen.rounds)
        return
    command = ["identify", pattern, "--out", str(results), "--quiet"]
    if chosen.profile:
        _profile(command)
    for round_ in range(0 if chosen.profile else 1 + chosen.rounds):
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
    if not chosen.profile:
        folder = Path(pattern).parent
        _tell_memory(sorted(map(str, folder.glob(Path(pattern).name))), results)


if __name__ == "__main__":
    main()
