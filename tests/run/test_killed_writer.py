"""A copy of a run that dies while it writes the signals costs time and no number."""

from __future__ import annotations

import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from damperfit import forked
from damperfit import workers as parallel
from damperfit.configuration.loading import load_configuration
from damperfit.run import writing
from damperfit.run.pipeline import run

LOGS = [
    str(Path(__file__).parents[2] / "sample_runs" / f"setting_{k:02d}.csv") for k in (1, 10, 20)
]


@pytest.mark.skipif(sys.platform != "linux", reason="copies are made on Linux alone")
def test_signals_that_a_dead_copy_leaves_are_the_same(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(parallel, "_FEWEST_APART", 2)
    real = writing.write_responses

    def written(name: str) -> bytes:
        configuration = load_configuration()
        output = replace(configuration.output, folder=tmp_path / name)
        run(replace(configuration, output=output), LOGS, jobs=2)
        return (tmp_path / name / "responses.parquet").read_bytes()

    undisturbed = written("undisturbed")
    died = tmp_path / "died"

    def dies(*arguments: object, **how: object) -> int:
        if forked.is_copy():
            died.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return real(*arguments, **how)

    monkeypatch.setattr(writing, "write_responses", dies)
    assert written("disturbed") == undisturbed
    assert died.exists()
