"""Memory and open files of `inspect` and `identify` with many small logs.

    python -m tests.benchmarks.many_logs 10000                 # inspect, 10 000 logs
    python -m tests.benchmarks.many_logs 1000 --command identify

The logs are the first 3.5 s of the sample logs, each with a line of its own. Linux only.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
N_ROWS = 1_750


@dataclass(frozen=True)
class Use:
    """What a command took."""

    code: int
    peak_mb: float
    open_files: int
    seconds: float

    def __str__(self) -> str:
        return (
            f"code {self.code}, peak {self.peak_mb:.0f} MB, {self.open_files} open files, "
            f"{self.seconds:.1f} s"
        )


def write_logs(folder: Path, n_logs: int) -> None:
    """Write that many small logs of twenty settings."""
    samples = sorted((ROOT / "sample_runs").glob("setting_*.csv"))
    texts = [path.read_text().splitlines(keepends=True) for path in samples]
    for i in range(n_logs):
        lines = texts[i % len(texts)]
        head = [line for line in lines if line.startswith("#")]
        rows = lines[len(head) : len(head) + 1 + N_ROWS]
        text = "".join([*head, f"# run: {i}\n", *rows])
        (folder / f"log_{i:05d}.csv").write_text(text)


def measure(command: str, folder: Path, *options: str) -> Use:
    """Run a command over all logs of a folder and watch it."""
    begin = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "damperfit", command, str(folder / "*.csv"), *options],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    open_files, peak = 0, 0
    place = Path(f"/proc/{process.pid}")
    while process.poll() is None:
        try:
            open_files = max(open_files, len(list((place / "fd").iterdir())))
            status = (place / "status").read_text()
        except OSError:  # it has just ended
            break
        if "VmHWM:" in status:
            peak = int(status.partition("VmHWM:")[2].split()[0])
        time.sleep(0.02)
    code = process.wait()
    return Use(code, peak / 1024, open_files, time.perf_counter() - begin)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Memory and open files with many logs.")
    parser.add_argument("n_logs", type=int, nargs="+")
    parser.add_argument("--command", choices=("inspect", "identify"), default="inspect")
    chosen = parser.parse_args()
    for n_logs in chosen.n_logs:
        with tempfile.TemporaryDirectory() as folder:
            write_logs(Path(folder), n_logs)
            print(n_logs, chosen.command, measure(chosen.command, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
