"""How long whole commands take, beside the bare import of the libraries they need."""

import json
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

import pytest

SAMPLES = Path(__file__).parents[2] / "sample_runs"
IMPORTS = "import numpy, scipy.signal, scipy.optimize, pandas, pyarrow, typer, rich"
ROUNDS = 5

pytestmark = pytest.mark.slow


def _seconds(*arguments: str) -> float:
    begin = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
    return time.perf_counter() - begin


def _identify(pattern: str, folder: Path) -> tuple[str, ...]:
    return "-m", "damperfit", "identify", pattern, "--out", str(folder), "--quiet"


def test_the_sample_runs_beside_bare_imports(tmp_path: Path) -> None:
    command = _identify(str(SAMPLES / "setting_*.csv"), tmp_path)
    pairs = [(_seconds(*command), _seconds("-c", IMPORTS)) for _ in range(ROUNDS + 1)][1:]
    ratio = statistics.median(ours / bare for ours, bare in pairs)
    ours = statistics.median(pair[0] for pair in pairs)
    print(f"\nidentify: {ours:.2f} s, {ratio:.2f} times the bare imports")
    assert json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))["failures"] == []


def test_two_hundred_logs_beside_bare_imports(tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    logs.mkdir()
    for source in SAMPLES.glob("setting_*.csv"):
        for run in range(10):
            shutil.copy(source, logs / f"{source.stem}_run{run}.csv")
    command = _identify(str(logs / "*.csv"), tmp_path / "results")
    pairs = [(_seconds(*command), _seconds("-c", IMPORTS)) for _ in range(3)]
    per_log = statistics.median((ours - bare) / 200 for ours, bare in pairs)
    print(f"\n200 logs: {1e3 * per_log:.1f} ms a log beyond start-up")
    record = json.loads((tmp_path / "results" / "run.json").read_text(encoding="utf-8"))
    assert len(record["inputs"]) == 200
