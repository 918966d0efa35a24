"""What a run keeps of a log, counted in bytes of arrays."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.identification.fit_problem import linearise
from damperfit.identification.fit_setting import minimised
from damperfit.run.identify import written
from damperfit.synthetic import SampleOptions, make_samples
from damperfit.uncertainty import assess, assessment
from tests.identification.rig import trace
from tests.identification.test_mean_cycle import on_cycles, problem

N_ROWS, BAR = 10_000, 0.5e6  # 10 s at 1 kHz; bytes a log of so many rows


def array_bytes(*kept: Any) -> int:
    """Bytes of all arrays that can be reached from objects, each block of memory once."""
    todo, known, blocks = list(kept), set(), {}
    while todo:
        one = todo.pop()
        if id(one) in known or isinstance(one, type) or callable(one):
            continue
        known.add(id(one))
        if isinstance(one, np.ndarray):
            while isinstance(one.base, np.ndarray):
                one = one.base
            blocks[id(one)] = one.nbytes
        else:
            todo += gc.get_referents(one)
    return sum(blocks.values())


def test_a_log_that_is_judged_keeps_half_a_megabyte(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Any] = []
    real = assessment.uncertainties

    def noted(linearised: Any, sharing: Any, **more: Any) -> Any:
        seen.extend(linearised)
        return real(linearised, sharing, **more)

    monkeypatch.setattr(assessment, "uncertainties", noted)
    logs = [trace(setting, noise=4.0) for setting in (3, 12)]
    assert all(len(log.force) > 0.85 * N_ROWS for log in logs)  # what is run up is cut
    campaign = identify(logs, PURDY_DAMPER)
    judged = assess(campaign, PURDY_DAMPER, solver=FitOptions().solver)
    kept = array_bytes(logs, campaign, judged)
    assert kept / len(logs) < BAR
    assert kept > sum(log.force.nbytes + log.displacement.nbytes for log in logs)
    # With residuals and weights of each log 0.14 MB more, while all settings are judged.
    assert len(seen) == 2
    more = array_bytes(logs, campaign, seen) - array_bytes(logs, campaign)
    assert 0 < more < 20_000 * len(logs)


def test_what_a_run_returns_holds_no_response(tmp_path: Path) -> None:
    options = SampleOptions(settings=(1, 2), cycles=5.0, force_noise=1.0)
    make_samples(tmp_path / "logs", options)
    settings = load_configuration(overlay={"output": {"folder": str(tmp_path / "out")}})
    (found,) = written(settings, [str(tmp_path / "logs" / "*.csv")], jobs=1)
    assert array_bytes(found.run) < 20_000
    assert len(found.run.signals) == 2  # read again where they are wanted


@pytest.mark.parametrize("way", [on_cycles, lambda whole: whole], ids=["cycles", "logs"])
def test_a_fit_keeps_a_triangle_that_gives_the_errors_of_the_whole(way) -> None:
    """A Jacobian as long as the log would stay through the first pass of all settings."""
    whole = problem([trace(10, noise=4.0)])
    found = minimised(way(whole), reference_parameters(10))
    assert found.jacobian.shape == (len(whole.free), len(whole.free))
    residuals, slopes = linearise(whole, found.values)
    variance = residuals @ residuals / found.n_independent
    errors = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)) * variance)
    assert list(found.errors.values()) == pytest.approx(errors, rel=1e-2)
