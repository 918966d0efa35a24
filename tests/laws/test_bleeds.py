"""Laminar bleeds are told from orifices and from preloads, and named."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.damper.mounting import FIT, Mounting
from damperfit.damper.network import Valve
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.laws import SettingLogs, Tried, bleeds, physics_seen, search, search_laws
from damperfit.laws.bleeds import with_bleeds_told
from damperfit.laws.choosing import effective_samples
from damperfit.laws.law_fit import LawFit
from damperfit.laws.search import _Search
from damperfit.laws.variants import BLEED, BLOW_OFF, BOTH, in_words, with_part
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import VALUES, damper, moved, noisy_trace

GAPS = Valve("leak", "linear")


def logged(rebound: Valve, numbers: dict[str, float], seed: int = 3) -> SettingLogs:
    """4 N and 8 um of noise, two speeds."""
    model = replace(damper(), rebound=rebound, compression=rebound, mounting=Mounting(FIT))
    known = {k: v for k, v in (VALUES | numbers).items() if k in model.names}
    motion = moved((0.06, 0.24), cycles=3)
    log = noisy_trace(model, known, motion, seed=seed, force_noise=4.0, jitter=8e-6)
    return SettingLogs(Setting.of(1), (log,))


def searched(logs: SettingLogs):
    layout = replace(damper(), rebound=BOTH, compression=BOTH)
    return search_laws(PURDY_DAMPER, [layout], [logs])


LAMINAR = Valve("leak", "none"), {"rebound_leak": 1.1e7, "compression_leak": 7e6}


def test_of_a_laminar_valve_no_blow_off_is_kept() -> None:
    logs = logged(*LAMINAR)
    course = _Search([logs], SolverOptions(), lambda _: None, 1)
    model = replace(damper(), rebound=BLOW_OFF, compression=BLOW_OFF, mounting=Mounting(FIT))
    law = course.fitted(model)
    course.n_eff = effective_samples(law, [logs])
    is_a_laminar_valve(with_bleeds_told(course, law))


def test_a_laminar_valve_is_no_blow_off_without_friction() -> None:
    """Its preload was next to nothing, and the 20 N of friction were gone."""
    is_a_laminar_valve(searched(logged(*LAMINAR)).chosen)


def is_a_laminar_valve(found: Tried) -> None:
    assert found.title.startswith("through flow: laminar bleed; elastic mounting")
    assert found.fits[0].values.f_f == pytest.approx(20.0, abs=1.0)
    assert found.fits[0].values.rebound_leak == pytest.approx(1.1e7, rel=0.02)
    said = " ".join(physics_seen(found.fits))
    assert "In rebound a laminar bleed of 0.93" in said
    assert "bar at 10 cm3/s, in step with the flow. In bump a laminar bleed of 0.59" in said


def test_a_laminar_bleed_beside_a_blow_off_is_no_orifice() -> None:
    logs = logged(GAPS, {"rebound_leak": 2.5e7, "compression_leak": 2e7})
    found = searched(logs).chosen
    assert found.title.startswith("through flow: laminar bleed and blow-off; elastic mounting")
    assert found.fits[0].values.f_f == pytest.approx(20.0, abs=2.0)


def test_an_orifice_beside_a_blow_off_is_no_laminar_bleed(monkeypatch) -> None:
    asked = []
    monkeypatch.setattr(search, "with_supposed_told", lambda _, law: asked.append(law) or law)
    found = searched(logged(BOTH, {})).chosen
    assert [one.fits[0].model for one in asked] == [found.fits[0].model]
    assert found.title.startswith("through flow: bleed and blow-off; elastic mounting")


def fit(model, mse: float, *, friction: float = 20.0, k: int = 6, held: float = math.nan):
    offered = SimpleNamespace(is_friction=True, name="f_f")
    kept = SimpleNamespace(
        rebound=model.rebound, compression=model.compression, quantities=(offered,), name="x",
        quantity=lambda _: SimpleNamespace(default=None),
    )  # fmt: skip
    return SimpleNamespace(
        fits=(
            SimpleNamespace(
                model=kept, values=SimpleNamespace(f_f=friction), free=("a",) * k,
                worst_force_percent=0.1, held_out="", at_bound=(),
            ),
        ),
        mse_percent=mse, n_quantities=k, held_out_percent=held, leaves_something=False, at_bound=(),
        surely_misses_a_force=False, sure_force_percent=0.0,
    )  # fmt: skip


def course(found, *, n_eff: float = 60.0):
    force = np.array([-500.0, 500.0])
    log = SimpleNamespace(force=force, compared=slice(None))
    return SimpleNamespace(
        fitted=lambda *_, **__: found, n_eff=n_eff, record=lambda *_, **__: None,
        evidence=[SimpleNamespace(fitted=(log,))],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("gain", "n_eff", "held", "is_taken"),
    [
        (1.11, 60.0, 1.0, True),
        (1.09, 60.0, 1.0, False),
        (1.11, 40.0, 1.0, True),
        (1.11, 30.0, 1.0, False),  # 30 ln 1.11 is below ln 30
        (2.0, 60.0, 1.09, True),
        (2.0, 60.0, 1.11, False),  # what was held out is predicted worse
    ],
)
def test_as_many_quantities_must_fit_better(monkeypatch, gain, n_eff, held, is_taken) -> None:
    model = replace(damper(), rebound=BOTH, compression=BOTH)
    monkeypatch.setattr(bleeds, "valve_damper", lambda _: model)
    law, other = fit(model, gain, held=1.0), fit(model, 1.0, held=held)
    assert (with_bleeds_told(course(other, n_eff=n_eff), law) is other) is is_taken


@pytest.mark.parametrize(("friction", "mse", "n_eff", "held", "is_taken"), [
    (99.0, 1.0, 60.0, math.nan, True), (101.0, 1.0, 60.0, math.nan, False),
    (20.0, 1.49, 60.0, math.nan, True), (20.0, 1.51, 60.0, math.nan, False),
    (20.0, 1.58, 10.0, math.nan, True), (20.0, 1.59, 10.0, math.nan, False),
    (20.0, 2.0, 60.0, 1.0 / 1.11, True), (20.0, 2.0, 60.0, 1.0 / 1.09, False),
])  # fmt: skip
def test_a_preload_is_no_friction(monkeypatch, friction, mse, n_eff, held, is_taken) -> None:
    """A fifth of 500 N. A preload is worth the factor of a larger law, and its two quantities:

    2 ln 10 of 10 ln of the MSE's rise. With it what was held out is predicted no worse. That all of
    it is next to nothing is no reason to leave it.
    """
    model = replace(damper(), rebound=BLOW_OFF, compression=BLOW_OFF)
    monkeypatch.setattr(bleeds, "valve_damper", lambda _: model)
    law = fit(model, 1e-4, k=8, held=1.0)
    other = fit(model, 1e-4 * mse, k=6, friction=friction, held=held)
    assert (with_bleeds_told(course(other, n_eff=n_eff), law) is other) is is_taken


def test_bleeds_of_both_kinds_may_have_a_laminar_part() -> None:
    model = replace(damper(), rebound=BOTH, compression=GAPS)
    assert with_part(model, "long").rebound == with_part(model, "long").compression
    assert in_words(with_part(model, "long")).startswith(
        "through flow: part-laminar bleed and blow-off;"
    )
    assert in_words(model).startswith(
        "through flow: bleed and blow-off in rebound, laminar bleed and blow-off in bump;"
    )


def test_what_a_stroke_lacks_is_offered_to_it() -> None:
    model = replace(damper(), rebound=Valve("orifice", "none"), compression=BLOW_OFF)
    assert with_part(model, "a blow-off in rebound").rebound == BOTH
    assert with_part(model, "a bleed in bump").compression == BOTH
    assert with_part(model, "a blow-off in bump") == model
    assert with_part(model, "a bleed in rebound") == model


def test_a_laminar_bleed_starts_with_what_both_of_its_ways_let_through() -> None:
    """With the laminar share alone it was too wide, and the descent ended elsewhere."""
    long = Valve("long", "linear")
    model = replace(damper(), rebound=long, compression=BLEED)
    numbers = VALUES | {"rebound_leak": 4e7, "rebound_bleed": 6e4, "rebound_opening": 5e5}
    values = model.values({n: numbers[n] for n in model.names if n in numbers})
    fit = LawFit(
        setting=Setting.of(1), model=model, values=values, free=(), at_bound=(), mse_percent=1.0,
        stretches=(), held_out_percent=math.nan, held_out="", residuals=(), evaluations=1,
    )  # fmt: skip
    gaps = replace(model, rebound=GAPS)
    [found] = bleeds._in_layers(Tried("", (fit,)), gaps).fits
    flow = 5e5 / found.values.rebound_leak
    assert 4e7 * flow + (6e4 * flow) ** 2 == pytest.approx(5e5)
    assert found.values.replace({"rebound_leak": 4e7}) == values
    both = Tried("", (fit,))
    assert bleeds._in_layers(both, replace(model, compression=GAPS)) is both  # it stays both
    plain = Tried("", (replace(fit, model=replace(model, rebound=Valve("long", "none"))),))
    assert bleeds._in_layers(plain, gaps) is plain  # no blow-off says at which flow
