"""What a process of its own costs, and whether SciPy should read MATLAB files in one.

    python -m tests.benchmarks.foreign_logs --format MATLAB       # 200 small logs, 5 large ones
    python -m tests.benchmarks.foreign_logs --format MDF --small 20 --large 1
    python -m tests.benchmarks.foreign_logs --damage 1000         # damaged MATLAB files: what ends

Each figure is that of a new Python that reads a folder, as `damperfit inspect` does in one thread:
seconds by the clock and of the processor, children counted, with all imports. A child is asked
for one log ("anew") or for all of them ("lasting").
"""

from __future__ import annotations

import argparse
import io
import os
import random
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

_READ = """
import os, sys, time
from pathlib import Path
import damperfit.conditioning  # what every command loads besides
from damperfit.readers import child_process, read_log
begin = time.perf_counter(), sum(os.times()[:4])
if sys.argv[2] == "anew":
    child_process._Children.give_back = lambda pool, child: child.end()
if sys.argv[2] == "scipy":
    from damperfit.readers import formats
    from tests.benchmarks import matlab_by_scipy
    matlab_by_scipy.use(formats)
n = sum(len(read_log(path).time) for path in sorted(Path(sys.argv[1]).iterdir()))
wall = time.perf_counter() - begin[0]
child_process._CHILDREN.end()
print(wall, sum(os.times()[:4]) - begin[1], n)
"""


def columns(n: int, seed: int) -> dict[str, np.ndarray]:
    """Return the channels of a log with noise, which packs as measured values do."""
    time_s = np.arange(n) / 1000.0
    noise = np.random.default_rng(seed).normal(size=(2, n))
    return {
        "time_s": time_s,
        "displacement_mm": 32.0 * np.sin(9.42 * time_s) + 0.003 * noise[0],
        "force_N": 900.0 * np.cos(9.42 * time_s) + 4.0 * noise[1],
    }


def matlab(n: int, seed: int, *, is_packed: bool) -> bytes:
    """Return a MATLAB file of version 7 or 6."""
    from scipy import io as scipy_io

    sink = io.BytesIO()
    held = {name: values[:, None] for name, values in columns(n, seed).items()}
    scipy_io.savemat(sink, held | {"f": 1.5, "title": "run"}, do_compression=is_packed)
    return sink.getvalue()


def matlab_73(n: int, seed: int) -> bytes:
    """Return a MATLAB file of version 7.3."""
    import h5py

    sink = io.BytesIO()
    with h5py.File(sink, "w") as file:
        for name, values in columns(n, seed).items():
            file[name] = values[None, :]
    return sink.getvalue()


def mdf(n: int, seed: int) -> bytes:
    """Return an MDF file of version 4."""
    import asammdf

    data = columns(n, seed)
    signals = [
        asammdf.Signal(data[f"{name}_{unit}"], data["time_s"], unit=unit, name=name)
        for name, unit in (("displacement", "mm"), ("force", "N"))
    ]
    sink = io.BytesIO()
    with asammdf.MDF(version="4.10") as file:
        file.append(signals)
        file.save(sink, overwrite=True)
    return sink.getvalue()


FORMATS = {
    "MATLAB 7": (".mat", lambda n, seed: matlab(n, seed, is_packed=True), ("scipy", "own")),
    "MATLAB 6": (".mat", lambda n, seed: matlab(n, seed, is_packed=False), ("scipy", "own")),
    "MATLAB 7.3": (".mat", matlab_73, ("anew", "lasting")),
    "MDF": (".mf4", mdf, ("anew", "lasting")),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--small", type=int, default=200, help="logs of 10 000 rows")
    parser.add_argument("--large", type=int, default=5, help="logs of a million rows")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--format", default="", help="those whose name begins so")
    parser.add_argument("--damage", type=int, default=0, help="damaged MATLAB files to read")
    asked = parser.parse_args()
    if asked.damage:
        damage(asked.damage)
        return
    print(
        f"{asked.small} logs of 10 000 rows, {asked.large} of 1 000 000; medians of "
        f"{asked.repeats}; {os.cpu_count()} cores"
    )
    chosen = {k: v for k, v in FORMATS.items() if k.startswith(asked.format)}
    for name, (suffix, write, ways) in chosen.items():
        for size, n_logs, n in (("small", asked.small, 10_000), ("large", asked.large, 1_000_000)):
            with tempfile.TemporaryDirectory() as folder:
                for i in range(n_logs):
                    Path(folder, f"log_s{i}{suffix}").write_bytes(write(n, i))
                for way in ways:
                    cost = np.median([read(folder, way) for _ in range(asked.repeats)], axis=0)
                    print(
                        f"{name:10} {size}: {way:8} {cost[0]:7.2f} s, processor {cost[1]:7.2f} s",
                        flush=True,
                    )


def damage(n_logs: int) -> None:
    """Print what comes of MATLAB files with one to four wrong bytes, by three ways."""
    from damperfit.readers import formats
    from tests.benchmarks import matlab_by_scipy
    from tests.readers import binary_logs, scenarios

    good = binary_logs.matlab(scenarios.Scenario(), is_packed=False)
    dice = random.Random(0)  # noqa: S311
    logs = []
    for _ in range(n_logs):
        wounded = bytearray(good)
        for _ in range(dice.choice((1, 2, 4))):
            wounded[dice.randrange(128, len(wounded))] = dice.randrange(256)
        logs.append(bytes(wounded))
    print(f"own reader: {dict(Counter(map(_outcome, logs)))}", flush=True)
    matlab_by_scipy.use(formats)
    print(f"SciPy, vectors alone: {dict(Counter(map(_outcome, logs)))}", flush=True)
    print(f"SciPy, all variables: {dict(Counter(map(_outcome_of_all, logs)))}", flush=True)


def _outcome(data: bytes) -> str:
    from damperfit.errors import LogError
    from damperfit.readers import read_log

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "log_s1.mat")
        path.write_bytes(data)
        try:
            read_log(path)
        except LogError as error:
            return "its process ended" if "its reader ended by" in str(error) else "refused"
        return "read"


def _outcome_of_all(data: bytes) -> str:
    from scipy.io import loadmat

    child = os.fork()
    if child == 0:
        try:
            loadmat(io.BytesIO(data))
        except Exception:  # noqa: BLE001  # whatever it is, it is no end of the process
            os._exit(1)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return "its process ended"
    return "refused" if os.WEXITSTATUS(status) else "read"


def read(folder: str, way: str) -> tuple[float, float]:
    """Return the seconds by the clock and of the processor that a folder takes."""
    command = [sys.executable, "-c", _READ, folder, way]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    return float(said[0]), float(said[1])


if __name__ == "__main__":
    main()
