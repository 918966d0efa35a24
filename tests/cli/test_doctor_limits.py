"""What `doctor` takes for a good fit of its made-up log: a case just inside, one just outside."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from damperfit import identification
from damperfit.cli.doctor import _fit
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import SimulationError


@pytest.mark.parametrize(("off", "is_right"), [(0.95e-3, True), (1.05e-3, False)])
def test_a_fit_is_right_within_a_thousandth(monkeypatch, off, is_right) -> None:
    truth = reference_parameters(10)
    found = SimpleNamespace(parameters=replace(truth, r_m1=(1.0 + off) * truth.r_m1))
    campaign = SimpleNamespace(fits=[found])
    monkeypatch.setattr(identification, "identify", lambda *_: campaign)
    if is_right:
        assert _fit().startswith("R_m1 of a made-up log within 0.1 %")
    else:
        with pytest.raises(SimulationError, match=r"R_m1 of a made-up log is 0.1 % off"):
            _fit()


def test_the_time_of_the_fit_is_its_own(monkeypatch) -> None:
    found = SimpleNamespace(parameters=reference_parameters(10))
    monkeypatch.setattr(identification, "identify", lambda *_: SimpleNamespace(fits=[found]))
    clock = iter((100.0, 101.5))
    monkeypatch.setattr("damperfit.cli.doctor.time", SimpleNamespace(perf_counter=clock.__next__))
    assert _fit().endswith(" %, 1.5 s")
