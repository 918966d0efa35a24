"""Bleeds that are part orifice, part gap: where they start beside one, and from both."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from damperfit.damper.mounting import Mounting
from damperfit.damper.network import Valve
from damperfit.identification.law_misfit import LawMisfit
from damperfit.laws.both_ways import with_both_ways
from damperfit.simulation import SolverOptions
from tests.laws.valve_logs import VALUES, damper, moved, noisy_trace

PLAIN = replace(damper(), mounting=Mounting())
LEAKS = {"rebound_leak": 2.4e7, "compression_leak": 2.2e7}
MORE = {
    **VALUES, **LEAKS, "rebound_width": 3e4, "compression_width": 3e4, "rebound_lift": 1e-7,
    "compression_lift": 1e-7, "rebound_port": 1e5, "compression_port": 1e5,
}  # fmt: skip


def with_valves(valve: Valve):
    return replace(PLAIN, rebound=valve, compression=valve)


def values_at(model, **own):
    return model.values({one: own.get(one, MORE.get(one)) for one in model.names
                         if one in own or one in MORE})  # fmt: skip


def misfit_of(model, logs) -> LawMisfit:
    free = tuple(one.name for one in model.quantities if one.default is None)
    return LawMisfit(model, logs, free, SolverOptions()).on_cycles()


@pytest.fixture(scope="module")
def logs():
    model = with_valves(Valve("long", "linear"))
    motion = moved((0.1, 0.2))
    numbers = {name: MORE[name] for name in model.names if name in MORE}
    return (noisy_trace(model, numbers, motion, seed=1, force_noise=2.0, jitter=3e-6),)


@pytest.mark.parametrize(("less", "more"), [
    (Valve("leak", "linear"), Valve("long", "linear")),
    (Valve("orifice", "linear"), Valve("long", "linear")),
    (Valve("none", "linear"), Valve("long", "linear")),
    (Valve("none", "linear"), Valve("leak", "linear")),
    (Valve("none", "linear"), Valve("orifice", "linear")),
    (Valve("orifice", "linear"), Valve("orifice", "rounded")),
    (Valve("orifice", "linear"), Valve("orifice", "lifting")),
    (Valve("orifice", "linear"), Valve("orifice", "port")),
    (Valve("leak", "none"), Valve("leak", "linear")),
    (Valve("leak", "none"), Valve("long", "linear")),
])  # fmt: skip
def test_a_law_does_what_a_smaller_one_does_where_it_has_no_more(logs, less, more) -> None:
    """From a laminar bleed a part-laminar one started closed, and ended at five times the MSE."""
    small, large = (misfit_of(with_valves(one), logs) for one in (less, more))
    at = values_at(small.model)
    known = {name: getattr(at, name) for name in small.free}
    beside = values_at(large.model).replace(known | large.absent_beside(known))
    assert large.cost(beside) == pytest.approx(small.cost(at), rel=0.01)


@pytest.mark.parametrize(("share", "is_both"), [(0.049, True), (0.051, False), (0.5, False),
    (0.949, False), (0.951, True), (0.0, True), (1.0, True)])  # fmt: skip
def test_a_bleed_that_is_next_to_nothing_in_one_way_starts_from_both(share, is_both) -> None:
    """What flows at 10 bar, where the blow-off opens, stays."""
    flow, opening = 0.02, 1e6
    long = replace(PLAIN, rebound=Valve("long", "linear"))
    at = values_at(
        long, rebound_leak=share * opening / flow, rebound_opening=opening,
        rebound_bleed=math.sqrt((1.0 - share) * opening) / flow,
    )  # fmt: skip
    found = with_both_ways(long, at)
    if not is_both:
        assert found == at
        return
    assert found.rebound_leak * flow == pytest.approx(0.5 * opening)
    assert (found.rebound_bleed * flow) ** 2 == pytest.approx(0.5 * opening)
    changed = {"rebound_leak", "rebound_bleed"}
    assert all(getattr(found, one) == getattr(at, one) for one in {*at.names} - changed)
    alone = replace(PLAIN, rebound=Valve("long", "none"))  # whose log tells both ways
    free = alone.values({n: getattr(at, n) for n in alone.names})
    assert with_both_ways(alone, free) == free
