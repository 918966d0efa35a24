"""A grade is withheld where a low MSE cannot excuse what was found; each limit from both sides."""

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import GasFacts
from damperfit.configuration.loading import load_configuration
from damperfit.damper.cylinder import Cavitation
from damperfit.damper.model import Quantity, values_type
from damperfit.damper.purdy.parameters import (
    PURDY_DAMPER,
    Damper,
    incompressible_force,
    reference_parameters,
)
from damperfit.identification import Status, identify
from damperfit.problem import Problem, warning
from damperfit.simulation import simulate, sine_motion
from damperfit.uncertainty import Assessment, Diagnosis, Uncertainty, assess, grades, objections
from damperfit.uncertainty.covariance import Interval
from damperfit.uncertainty.grades import LIMITS, air_objections, jump_ratio, offset_mismatch
from damperfit.uncertainty.residuals import Hint
from tests import fakes
from tests.fakes import campaign
from tests.identification.rig import short_trace
from tests.uncertainty.faults import FAULTS, outcome

GAS = GasFacts(
    rod_area=PURDY_DAMPER.rod_area,
    pressure=PURDY_DAMPER.gas_pressure,
    volume=PURDY_DAMPER.gas_volume,
    exponent=PURDY_DAMPER.gas_exponent,
)


def told(mse=0.05, noise=0.002, *, misses=True, hints=()):
    return Diagnosis(1, mse, noise, misses, hints, "")


def reasons(fit, seen=None, gas=None):
    diagnoses = () if seen is None else (replace(seen, setting=fit.setting),)
    found = objections(campaign(fit), Assessment(diagnoses=diagnoses), gas)
    return found.get(fit.setting, ())


def kinds(*given):
    return [reason.kind for reason in reasons(*given)]


def having(*, mse=0.05, status=None, **values):
    fit = fakes.fit(1, mse=mse, status=status)
    return replace(fit, parameters=replace(fit.parameters, **values))


def logged(fit, **changes):
    """The same fit of a log with other facts."""
    (log,) = fit.logs
    return replace(fit, logs=(log._replace(trace=replace(log.trace, **changes)),))


@pytest.mark.parametrize(
    ("times", "share", "error", "is_withheld"),
    [
        (2.0, 1.0, 1.0, True),  # both signs declared wrongly: the tare takes up the gas force twice
        (1.7, 1.0, 1.0, True),  # a tare of the cell besides
        (1.0, 1.0, 1.0, False),  # tared with the damper mounted
        (1.5, 1.0, 1.0, False),
        (2.5, 1.0, 1.0, False),
        (-2.0, 1.0, 1.0, False),
        (2.0, 1.0, 40.0, False),  # not beyond four standard errors
        (2.0, 0.2, 1.0, False),  # a gas force like any tare
    ],
)
def test_an_offset_that_turns_the_gas_force_round_withholds(
    times, share, error, is_withheld
) -> None:
    gas = GAS._replace(rod_area=share * GAS.rod_area)
    fit = having(mse=0.001, status={"f_0": "fitted"}, f_0=times * gas.force)
    known = Interval(error, 0.0, 0.0)
    assessment = Assessment(uncertainties=(Uncertainty(fit.setting, {"f_0": known}, (), None),))
    found = objections(campaign(fit), assessment, gas).get(fit.setting, ())
    assert ("direction" in {one.kind for one in found}) is is_withheld
    held = replace(fit, status={**fit.status, "f_0": Status.FIXED})
    without = Assessment(uncertainties=(Uncertainty(fit.setting, {}, (), None),))
    assert objections(campaign(held), without, gas) == {}


def test_a_sound_fit_keeps_its_grade() -> None:
    assert kinds(having(), told(0.01, 0.0099, misses=False), GAS) == []


@pytest.mark.parametrize(
    ("k_e", "is_oil"), [(2.99e7, False), (3.01e7, True), (2.99e9, True), (3.01e9, False)]
)
def test_a_bulk_modulus_that_no_oil_has(k_e, *, is_oil) -> None:
    said = [one.sentence for one in reasons(having(k_e=k_e))]
    assert len(said) == (not is_oil)
    assert all("is beyond 30 to 3000 MPa: oil has 1500 MPa" in one for one in said)
    for status in (Status.FIXED, Status.NOT_IDENTIFIABLE):  # held, or not told: no finding
        assert kinds(having(k_e=k_e, status={"k_e": status})) == []


def test_a_quantity_at_its_bound_is_told_with_the_limit() -> None:
    (reason,) = reasons(having(r_m1=10.0, status={"r_m1": Status.AT_BOUND}))
    assert (reason.kind, reason.quantity) == ("bound", "r_m1")
    assert "R_m1 is at a bound of its range (below 10 " in reason.sentence


@pytest.mark.parametrize(
    ("bar", "hints"), [(0.2, (Hint("delay", "reversals", 0.9, 3.0, "late"),)), (0.02, ())]
)
@pytest.mark.parametrize(
    ("size", "times", "is_withheld"),
    [(1.01, 30.1, True), (1.01, 29.9, False), (0.99, 100.0, False), (2.5, np.inf, True)],
)
def test_what_repeats_many_times_the_noise(bar, hints, size, times, *, is_withheld) -> None:
    repeats, noise = bar * size, bar * size / times
    assert (LIMITS.times_noise, LIMITS.misfit_percent) == (30.0, 0.2)
    assert kinds(having(), told(repeats + noise, noise, hints=hints)) == ["misfit"] * is_withheld


@pytest.mark.parametrize(("times", "is_withheld"), [(1.02, True), (0.98, False)])
@pytest.mark.parametrize(
    ("code", "limit"),
    [("force_clipping", 4.0), ("displacement_clipping", 4.0), ("force_trend", 5.0),
     ("force_trend", -5.0)],
)  # fmt: skip
def test_a_log_that_is_clipped_or_whose_force_fades(code, limit, times, *, is_withheld) -> None:
    warned = warning(code, "it is", value=times * limit, unit="%")
    found = reasons(logged(having(), name="cut.csv", findings=(warned,)), told(misses=False))
    assert [one.kind for one in found] == ["log"] * is_withheld
    assert all("cut.csv" in one.sentence for one in found)


@pytest.mark.parametrize(("amount", "is_withheld"), [(3.1, True), (-3.1, True), (2.9, False)])
def test_a_load_cell_that_is_bent(amount, *, is_withheld) -> None:
    bent = told(hints=(Hint("load_cell", "peak", 0.9, amount, "a bent load cell"),))
    assert ("log" in kinds(having(), bent)) is is_withheld
    assert kinds(having(), replace(bent, is_structured=False)) == []


@pytest.mark.parametrize(("source", "withheld"), [(1, {1, 2}), (2, {1})])
def test_a_drifting_zero_spoils_what_its_setting_gives_to_others(source, withheld) -> None:
    drift = warning("force_drift", "drifts", value=1.5, unit="%")
    fits = logged(fakes.fit(1), findings=(drift,)), fakes.fit(2)
    shared = replace(fakes.campaign().sharing, taken={"r_m3": fits[source - 1].setting})
    found = objections(campaign(*fits, sharing=shared), Assessment(), None)
    assert {int(str(setting)) for setting in found} == withheld


@pytest.mark.parametrize(("percent", "withheld"), [("3.4", {1}), ("3.6", set())])
def test_a_log_further_off_all_others_may_be_another_test(percent, withheld) -> None:
    values = {"log": "of_1.csv", "what": "clock", "percent": percent}
    fits = logged(fakes.fit(1), name="of_1.csv"), fakes.fit(2)
    off = Assessment(apart=(warning("clock-apart", "{log}", **values),))
    assert {int(str(setting)) for setting in objections(campaign(*fits), off, None)} == withheld


@pytest.mark.parametrize(
    "name",
    [
        "stroke 1.03 times in one",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in (
                "clock 1.02 times in one", "cell of 0.05 second order", "zero drifts by -20 N",
                "oil thinner by 0.06 at the end", "mean over 40 ms before the noise",
                "0.008 of free gas",
            )
        ),
    ],
)  # fmt: skip
def test_no_number_that_a_fault_puts_off_has_a_grade(name) -> None:
    _, off, is_named = outcome(*FAULTS[name])
    assert is_named
    assert not off


@pytest.mark.parametrize("code", ["rig_filter", "force_smoothed", "values_repeated"])
@pytest.mark.parametrize("severity", ["warning", "note"])
def test_a_log_whose_warning_is_of_spoilt_numbers(severity, code) -> None:
    is_warned = severity == "warning"
    drifting = Problem("force_drift", "it drifts", severity, values={"value": 2.0})
    held = logged(having(status={"f_0": Status.FIXED}), findings=(drifting,))
    assert kinds(held, told(misses=False)) == ["log"] * is_warned
    free = replace(held, status={**held.status, "f_0": Status.FITTED})
    assert kinds(free, told(misses=False)) == []
    filtered = logged(having(), findings=(Problem(code, "both are filtered", severity),))
    for noise, is_missed in ((0.05 / 31.1, True), (0.05 / 30.9, False)):
        found = kinds(filtered, told(0.05, noise))
        assert ("log" in found) == (is_warned and is_missed)


@pytest.mark.parametrize(("share", "is_withheld"), [(0.051, True), (0.049, False)])
def test_cavitation_that_nothing_speaks_for(share, *, is_withheld) -> None:
    empty = Cavitation(fraction=share, lowest_pressure=0.0, chamber=2)
    fit = replace(having(), cavitation=empty)
    assert kinds(fit, told()) == ["cavitation"] * is_withheld
    # A model that meets the log to its noise is believed; so is a low MSE whose noise is unknown.
    assert kinds(fit, told(misses=False)) == []
    assert kinds(replace(fit, mse_percent=0.19)) == []
    assert kinds(replace(fit, mse_percent=0.21)) == ["cavitation"] * is_withheld


def test_an_offset_far_from_that_of_the_log() -> None:
    # Its force at no speed is that of the gas: the log shows an offset of nothing.
    far, seen = offset_mismatch(having(f_0=100.0), "f_0", GAS)
    assert seen == pytest.approx(0.0, abs=3.0)
    limit = (100.0 - seen) / far
    assert 30.0 < limit < 60.0  # a quarter of the gas force and what the level may be wrong by
    for times, found in ((1.02, ["offset"]), (0.98, []), (-1.02, ["offset"])):
        assert kinds(having(f_0=seen + times * limit), told(), GAS) == found
    assert kinds(having(f_0=100.0), told(misses=False), GAS) == []
    assert kinds(having(f_0=100.0), told()) == []
    # A fit that leaves nothing to explain knows the offset better than the level does.
    for times, found in ((1.05, ["offset"]), (0.95, [])):
        mse = times * LIMITS.nothing_percent
        assert kinds(having(mse=mse, f_0=100.0), told(), GAS) == found
    (reason,) = reasons(having(f_0=-218.0), told(), GAS)
    assert reason.sentence == f"f_0 is -218 N where the log shows {seen:.0f} N"


def rubbing(friction):
    """A fit of a log whose force has a jump of twice the friction at each reversal, no more."""
    fit = having()
    trace = fit.logs[0].trace
    long = replace(trace.segments[0], first=20, stop=980)
    return logged(fit, force=friction * np.sign(trace.velocity), segments=(long,))


@pytest.mark.parametrize(("ratio", "is_withheld"), [(1.26, True), (1.24, False)])
def test_friction_beyond_the_jump_at_the_reversals(ratio, *, is_withheld) -> None:
    fit = rubbing(50.0 / ratio)
    assert jump_ratio(fit, 50.0) == pytest.approx(ratio, rel=1e-6)
    assert kinds(fit, told()) == ["friction"] * is_withheld
    assert kinds(fit, told(misses=False)) == []


def lagging(fit, lag):
    late = Quantity("lag", "T", "", "", "s", (1e-5, 5e-2))
    values = values_type((*fit.parameters.quantities, late))(*fit.parameters.numbers, lag)
    return replace(fit, parameters=values)


def test_a_late_jump_is_that_of_a_late_friction() -> None:
    fit = rubbing(50.0)
    trace = fit.logs[0].trace
    lag, force = 0.008, trace.force.copy()
    for k in range(1, len(force)):  # the slow twin: T g' + g = f, f a line between two samples
        before, now = trace.force[k - 1 : k + 1]
        behind = lag * (now - before) / trace.interval
        force[k] = now - behind + np.exp(-trace.interval / lag) * (force[k - 1] - before + behind)
    late = lagging(logged(fit, force=force), lag)
    assert jump_ratio(late, 50.0) == pytest.approx(1.0, rel=1e-6)
    assert jump_ratio(late, 70.0) == pytest.approx(1.4, rel=1e-6)
    for short in (0.0, 1e-6, 1e-5):  # the shortest leaves nothing of the sample before
        assert jump_ratio(lagging(fit, short), 50.0) == pytest.approx(1.0, rel=1e-3)


def of_gas(name="gas_volume", share=0.95):
    return Hint(name, "position", share, 29.0, "a wrong gas or rod volume (29 N at full stroke)")


def about_dimensions(*seen, assumed=""):
    fits = [fakes.fit(k, mse=one.mse_percent) for k, one in enumerate(seen, 1)]
    diagnoses = tuple(replace(one, setting=k) for k, one in enumerate(seen, 1))
    found = objections(campaign(*fits), Assessment(diagnoses=diagnoses), assumed=assumed)
    each = ((setting, one) for setting, why in found.items() for one in why)
    return [(setting, one.sentence) for setting, one in each if one.kind == "dimensions"]


@pytest.mark.parametrize(
    ("mse", "noise", "hints", "is_withheld"),
    [
        (0.05, 0.001, (of_gas(),), True),
        (0.05, 0.001, (of_gas("gas_stiffness"),), True),
        (0.05, 0.001, (of_gas(share=0.89),), False),
        (0.05, 0.001, (of_gas("offset"),), False),
        (0.05, 0.001, (), False),
        (0.0201, 0.0006, (of_gas(),), True),
        (0.0199, 0.0006, (of_gas(),), False),  # too little to mind
        (0.05, 0.05 / 31.1, (of_gas(),), True),
        (0.05, 0.05 / 30.9, (of_gas(),), False),
        (0.05, float("nan"), (of_gas(),), False),
    ],
)
def test_a_misfit_of_another_gas_spring_or_rod(mse, noise, hints, *, is_withheld) -> None:
    said = about_dimensions(told(mse, noise, hints=hints))
    assert len(said) == is_withheld
    assert all("the rest looks like a wrong gas or rod volume (29 N" in one for _, one in said)


@pytest.mark.parametrize(("times", "is_withheld"), [(5.1, True), (4.9, False)])
def test_a_gas_spring_that_no_damper_of_the_declared_size_has(times, *, is_withheld) -> None:
    fit = having()
    (trace,) = (log.trace for log in fit.logs)
    stiffness = GAS.exponent * GAS.rod_area**2 * GAS.pressure / GAS.volume
    declared = stiffness * np.abs(trace.displacement[trace.compared]).max()
    hint = replace(of_gas(share=0.7), amount=(times - 1.0) * declared)
    found = kinds(fit, told(0.1, 0.001, hints=(hint,)), GAS)
    assert ("dimensions" in found) is is_withheld


@pytest.mark.parametrize(("mse", "is_withheld"), [(0.0201, True), (0.0199, False)])
def test_a_misfit_with_dimensions_that_nobody_gave(mse, *, is_withheld) -> None:
    seen, assumed = told(mse, mse / 40.0), "[damper] is not declared, and with a generic damper"
    assert about_dimensions(seen) == []
    said = about_dimensions(seen, told(0.005, 0.0049, misses=False), assumed=assumed)
    assert [setting for setting, _ in said] == [1] * is_withheld
    assert all(one.startswith(f"{assumed} the MSE is 0.02 %, of which") for _, one in said)


# The air on the rod, which the paper's equation leaves out

WITHOUT = Damper(rod_diameter=0.022)
WITH = replace(WITHOUT, ambient_pressure=101325.0)


def of_air(damper, **identification):
    """What is said of a log of a damper by somebody who leaves the air out."""
    overlay = {"damper": {"rod_diameter": "22mm"}, "identification": identification}
    configuration = load_configuration(overlay=overlay)
    model, options = configuration.damper, configuration.identification
    found = identify([short_trace(10, damper=damper, noise=4.0)], model, options)
    return found, model, options, assess(found, model)


def test_the_air_adds_its_pressure_times_the_rod_to_every_force() -> None:
    motion, y = sine_motion(0.02, 1.0, cycles=1, sample_rate=500), reference_parameters(10)
    force = WITH.rod_area * 101325.0
    apart = simulate(y, WITH, motion).force - simulate(y, WITHOUT, motion).force
    assert apart == pytest.approx(force, rel=1e-9)
    assert WITH.rest_force(0.01) - WITHOUT.rest_force(0.01) == pytest.approx(force)
    closed = [incompressible_force(y, one, [0.01], [0.2]) for one in (WITH, WITHOUT)]
    assert closed[0] - closed[1] == pytest.approx(force)
    assert force == pytest.approx(38.52, abs=0.01)


@pytest.mark.parametrize(
    ("damper", "identification", "is_told"),
    [
        (WITH, {}, True),
        (WITHOUT, {}, False),
        (WITH, {"free": ["r_m1", "r_m2", "k_e", "f_0"]}, False),  # which takes its place
    ],
)
def test_where_the_logs_show_the_air_the_grade_is_withheld(damper, identification, is_told) -> None:
    found, model, options, judged = of_air(damper, **identification)
    said = list(air_objections(found, judged, model, options, jobs=1).values())
    assert [one.kind for one in said] == ["dimensions"] * is_told
    assert all('set damper.ambient_pressure = "1.013bara"' in one.sentence for one in said)


@pytest.mark.parametrize(("mean", "is_certain"), [(3.99, False), (4.01, True)])
def test_the_squares_fall_by_four_standard_errors(mean, is_certain) -> None:
    around = np.array([-1.0, 1.0] * 8)  # sixteen cycles
    error = float(np.std(around, ddof=1)) / 4.0
    assert grades.is_certain((around + mean * error).tolist()) is is_certain
    assert grades.is_certain([1.0, 1.1])
    assert not grades.is_certain([1.0])
