"""Every model of `MODELS`: simulated, differentiated, recovered, judged, laid out, shown."""

from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import damperfit
from damperfit.conditioning import condition
from damperfit.configuration.loading import load_configuration
from damperfit.damper.model import FLAWS_OF_OIL, MODELS, Model, Values, model_named
from damperfit.damper.purdy.parameters import reference_parameters
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.errors import ConfigurationError
from damperfit.identification import Campaign, FitOptions, Status, compare, identify
from damperfit.recording import Trace
from damperfit.reporting.sheet import escape
from damperfit.results import Run
from damperfit.run.identify import identified
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.tested.setting import Setting
from damperfit.uncertainty import Assessment, assess
from damperfit.uncertainty.covariance import linearise_at_fit
from damperfit.uncertainty.residuals import seek_flaws, signatures
from tests.damper.test_rivals import NUMBERS
from tests.damper.test_valve_dampers import VALVES
from tests.identification.rig import recorded
from tests.test_numbers import check

EVERY = pytest.mark.parametrize("name", MODELS)
RATE, NOISE = 500.0, 2.0
ROUGH = SolverOptions(tolerance=1e-2)

TRUTH = {
    "purdy": asdict(reference_parameters(5)),
    "twin_tube": {**VALVES, "k_s": 4e5},
    "monotube": {**VALVES, "k_s": 4e5},
    "through_flow": {**VALVES, "k_s": 4e5},
    "network": {**VALVES, "k_s": 4e5},
    **NUMBERS,
}


@dataclass(frozen=True, eq=False)
class Case:
    """A model, its true numbers, and what became of a log of them."""

    model: Model
    truth: Values
    trace: Trace
    campaign: Campaign
    assessment: Assessment


def damper(name: str) -> Model:
    """The paper's damper is as it is; a monotube needs pressure to stay full."""
    made = {
        "twin_tube": TwinTube(),
        "through_flow": ThroughFlow(),
        "monotube": Monotube(gas_pressure=2.5e6),
    }
    return made.get(name) or model_named(name)()


def truth_of(model: Model) -> Values:
    numbers = TRUTH.get(model.name)
    if numbers is None:  # polynomials
        numbers = {one.name: 0.1 * one.size / (k + 1) for k, one in enumerate(model.quantities)}
        numbers["c_1"] = 2e3 if "c_1" in model.names else 0.0
        numbers = {key: value for key, value in numbers.items() if key in model.names}
    return model.values({key: numbers[key] for key in numbers if key in model.names})


def log_of(model: Model, truth: Values) -> Trace:
    """Six cycles of 20 mm at 1.5 Hz."""
    t = np.arange(-400, round(6.2 / 1.5 * RATE)) / RATE
    angle = 2.0 * np.pi * 1.5 * t + 0.4
    x, v = 0.02 * np.sin(angle), 0.02 * 2.0 * np.pi * 1.5 * np.cos(angle)
    force = simulate(truth, model, Motion(1.0 / RATE, x, v), options=ROUGH).force
    noise = np.random.default_rng(7).normal(0.0, NOISE, len(t))
    part = t >= 0.0
    name = "run_5.csv"
    return condition(recorded(x[part], (force + noise)[part], RATE, setting=5, name=name))


@cache
def case(name: str) -> Case:
    model = damper(name)
    truth = truth_of(model)
    trace = log_of(model, truth)
    campaign = identify([trace], model, FitOptions("plain", max_evaluations=60))
    assessment = assess(campaign, model)
    return Case(model, truth, trace, campaign, assessment)


@EVERY
def test_values_have_its_order_and_its_force_is_differentiated_by_every_number(name: str) -> None:
    one = case(name)
    assert one.truth.names == one.model.names == tuple(q.name for q in one.model.quantities)
    wanted = (*one.model.names, *one.model.conditions)
    seen = compare(one.truth, one.trace, one.model, sensitivities=wanted, solver=ROUGH)
    assert seen.sensitivities.shape == (len(wanted), len(one.trace.force))
    assert np.all(np.isfinite(seen.sensitivities))
    slope = np.array([float(np.abs(row).max()) for row in seen.sensitivities])
    held = {q.name for q in one.model.quantities if q.default == getattr(one.truth, q.name)}
    told = [k for k, name in enumerate(wanted) if name not in held and name in one.model.names]
    assert np.all((slope[told] > 0.0) | [one.model.quantity(wanted[k]).is_offset for k in told])


@pytest.mark.one_in(2)
@EVERY
def test_it_is_told_of_no_flaw_that_it_cannot_have(name: str) -> None:
    one = case(name)
    (fit,) = one.campaign.fits
    seen = linearise_at_fit(fit, one.model, solver=ROUGH)
    assert seen.flaws == one.model.flaws
    stiff = [np.ones(one.trace.n_samples)]
    force, pressures = one.trace.force[one.trace.compared], np.ones((2, len(one.trace.force)))
    known = set(signatures(one.trace, force, stiff, pressures))
    assert set(one.model.flaws) <= known
    assert bool(set(FLAWS_OF_OIL) & set(one.model.flaws)) == bool(one.model.signals)
    late = 2e-3 * np.gradient(seen.logs[0].force, one.trace.interval)
    log = seen.logs[0]._replace(residuals=-late)
    hints, _ = seek_flaws(replace(seen, logs=(log,)), float(np.mean(late**2)))
    possible = {*one.model.flaws, *one.model.conditions, *one.model.names}
    assert {hint.name for hint in hints} <= possible
    unnamed = replace(seen, logs=(log,), flaws=(), conditions=())
    hints, _ = seek_flaws(unnamed, float(np.mean(late**2)))
    assert {hint.name for hint in hints} <= set(one.model.names)


@EVERY
def test_its_own_log_is_met_to_the_noise_and_the_truth_is_inside_the_intervals(name: str) -> None:
    one = case(name)
    (fit,) = one.campaign.fits
    measured = one.trace.force[one.trace.compared]
    floor = 100.0 * NOISE**2 / float(np.var(measured))
    assert fit.mse_percent < max(3.0 * floor, 0.02), fit.outcome
    assert list(fit.status) == list(one.model.names)
    (known,) = one.assessment.uncertainties
    for quantity in one.model.quantities:
        if fit.status[quantity.name] is not Status.FITTED:
            continue
        interval, true = known.intervals[quantity.name], getattr(one.truth, quantity.name)
        assert interval.low < getattr(fit.parameters, quantity.name) < interval.high
        if quantity.is_logarithmic and interval.error < 0.1 * abs(true):
            off = abs(getattr(fit.parameters, quantity.name) - true) / interval.error
            assert off < 5.0 or fit.mse_percent > 2.0 * floor, (quantity.name, off)


@EVERY
def test_no_number_of_it_has_moved(name: str) -> None:
    check(f"model {name}")


@cache
def fresh(name: str) -> Run:
    """Two settings of a model, fitted and judged by the whole of `identify`."""
    trace = case(name).trace
    harder = replace(trace, name="run_6.csv", setting=Setting.of(6), force=1.05 * trace.force)
    logs = [replace(trace, setting=Setting.of(5)), harder]
    fit = FitOptions("plain", max_evaluations=30)
    configuration = load_configuration().with_damper(damper(name), identification=fit)
    (one,) = identified(configuration, [], traces=logs, jobs=1)
    return one.run


@EVERY
def test_a_fresh_run_is_asked_shown_handed_on_and_compared_without_a_folder(
    name: str, tmp_path: Path
) -> None:
    run = fresh(name)
    assert [one.label for one in run.settings] == ["5", "6"]
    forces = damperfit.settings(run, velocity="0.1m/s").to_frame()
    assert set(forces["setting"]) == {5, 6}
    assert np.all(np.isfinite(forces["force_N"]))
    simulated = damperfit.simulate(5, parameters=run, amplitude=0.02, frequency=1.5)
    assert np.all(np.isfinite(simulated.force))
    (page,) = damperfit.report(run, out=tmp_path)
    shown = page.read_text()
    for quantity in run.quantities:
        values = [getattr(one.values, quantity.name) for one in run.settings]
        if set(values) != {quantity.default}:
            assert quantity.symbol in shown, quantity.name
            assert escape(quantity.symbol) in run.report_text, quantity.name
    assert damperfit.export(run, to="csv", out=tmp_path / "csv")
    assert damperfit.compare(run, run).is_met
    saved = damperfit.load(run.save(tmp_path / "saved"))
    assert saved.quantities == run.quantities == case(name).model.quantities
    assert saved.parameters.equals(run.parameters)
    assert [one.values for one in saved.settings] == [one.values for one in run.settings]


def test_a_model_that_is_not_known_is_refused_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match=r"no model 'bouc_wenn'\. Did you mean 'bouc_wen'"):
        model_named("bouc_wenn")
