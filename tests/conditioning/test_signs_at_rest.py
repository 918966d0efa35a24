"""The force at rest, and the other logs of a rig, tell how channels are counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import damperfit
from damperfit.conditioning import condition
from damperfit.configuration.loading import load_configuration
from tests.conditioning.logs import recording

RATE = 500.0
GAS = 130.4


def digressive(*, mirror=1.0, rest=0.6, tare=0.0, seed=1):
    """A damper whose valves open at once, so that its loop hides the gas force."""
    t = np.arange(round(8.0 * RATE)) / RATE
    x = 0.02 * np.sin(2.0 * np.pi * 1.5 * np.clip(t - rest, 0.0, None))
    v = np.gradient(x, 1.0 / RATE)
    opening = np.where(v > 0.0, 400.0, 160.0) * np.tanh(v / 0.005)
    random = np.random.default_rng(seed)
    force = opening + 900.0 * v + 12.0 * np.tanh(v / 1e-3) - GAS + tare
    x = x + 3e-6 * random.standard_normal(len(x))
    return recording(t, mirror * x, mirror * (force + random.standard_normal(len(x))))


def reversed_channels(trace):
    names = (finding.name for finding in trace.findings if finding.is_correction)
    return [name.removesuffix("_polarity") for name in names]


@pytest.fixture(scope="module")
def options():
    """What a run of the paper's damper conditions with."""
    return load_configuration().conditioning


@pytest.mark.parametrize(
    ("displacement", "force"), [(1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0)]
)
def test_a_rest_shows_the_signs_of_both_channels(options, displacement, force):
    log = digressive()
    log = replace(log, displacement=displacement * log.displacement, force=force * log.force)
    trace = condition(log, options)
    wrong = [n for n, s in (("displacement", displacement), ("force", force)) if s < 0.0]
    assert reversed_channels(trace) == wrong
    assert trace.shows_signs


def test_logs_without_a_rest_are_counted_as_the_others_of_the_batch(tmp_path):
    paths = []
    for k, rest in enumerate([0.6, 0.0, 0.7, 0.0]):
        log = digressive(mirror=-1.0, rest=rest, seed=k)
        paths.append(tmp_path / f"setting_{k + 1}.csv")
        columns = np.column_stack([log.time, 1e3 * log.displacement, log.force])
        np.savetxt(
            paths[-1], columns, "%.5f", ",", header="time_s,displacement_mm,force_N", comments=""
        )
    alone = damperfit.inspect(paths[1]).batch.logs[0].facts
    assert alone["verdict"] == "warnings"
    assert alone["reversed"] == []
    together = [log.facts for log in damperfit.inspect(paths).batch.logs]
    assert [log["reversed"] for log in together] == [["displacement", "force"]] * 4
    assert not any("direction" in f["name"] for log in together for f in log["findings"])
