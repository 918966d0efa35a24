"""Ctrl-C and SIGTERM: finished settings are written, the code is 130, nothing is left half done."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from damperfit.cli.watching import stop_on_signal
from damperfit.configuration.loading import load_configuration
from damperfit.run.identify import Watch, written

ROOT = Path(__file__).parents[2]


def test_finished_settings_are_written_when_the_user_stops(logs, fitted_anew, tmp_path) -> None:
    stop = threading.Event()
    settings = load_configuration(overlay={"output": {"folder": str(tmp_path / "out")}})
    watch = Watch(on_fit=lambda _fit: stop.set(), cancelled=stop.is_set)
    (result,) = written(settings, [str(logs / "setting_*.csv")], jobs=1, watch=watch)
    assert result.run.exit_code == 130
    table = pq.read_table(tmp_path / "out" / "parameters.parquet")
    assert table["setting"].to_pylist() == [1]
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert (record["ending"], record["exit_code"]) == ("interrupted", 130)
    assert "Interrupted" in (tmp_path / "out" / "report.md").read_text()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_asks_to_stop_and_a_second_one_ends_at_once(number, capsys) -> None:
    before = signal.getsignal(number)
    with stop_on_signal() as cancelled:
        assert not cancelled()
        os.kill(os.getpid(), number)
        assert cancelled()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert signal.getsignal(number) is before
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    ("number", "jobs"),
    [
        (signal.SIGINT, 1),
        pytest.param(signal.SIGTERM, 1, marks=pytest.mark.slow),
        pytest.param(signal.SIGINT, 2, marks=pytest.mark.slow),  # in copies of the process
        (signal.SIGHUP, 2),  # as a lost terminal sends it
    ],
)
def test_the_command_ends_with_130_and_no_temporary_file(
    logs, repeated, tmp_path, number, jobs
) -> None:
    text = (logs / "setting_01.csv").read_text()
    for i in range(20 * jobs):  # enough work for a signal to arrive in the middle of it
        content = repeated(text, i).replace("setting: 1\n", f"setting: {i}\n")
        (tmp_path / f"setting_{i}.csv").write_text(content)
    process = subprocess.Popen(
        [sys.executable, "-m", "damperfit", "identify", "*.csv", "--jobs", str(jobs)],
        cwd=tmp_path,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(number, signal.SIG_DFL),  # noqa: PLW1509 - under nohup it is ignored
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with process:
        _wait_until_numerics_are_loaded(process)
        os.killpg(process.pid, number)  # as a terminal does
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.count("stopping") <= 1
    assert "Traceback" not in err
    results = tmp_path / "results"
    assert [p.name for p in results.glob(".*")] == []
    assert not results.exists() or json.loads((results / "run.json").read_text())


def _wait_until_numerics_are_loaded(process: subprocess.Popen) -> None:
    maps = Path(f"/proc/{process.pid}/maps")
    if not maps.exists():
        pytest.skip("needs /proc")
    deadline = time.monotonic() + 30.0
    while "damperfit/damper/_core" not in maps.read_text():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
