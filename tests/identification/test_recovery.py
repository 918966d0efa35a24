"""Known parameters come back: noise-free to 1e-6, noisy to the bars of the paper's procedure."""

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.damper.cylinder import Cavitation, describe_cavitation, examine_cavitation
from damperfit.damper.purdy.parameters import (
    PURDY_DAMPER,
    Damper,
    Parameters,
    incompressible_force,
    reference_parameters,
)
from damperfit.identification import Campaign, Fit, FitOptions, Outcome, compare, identify
from damperfit.identification.fit_problem import Block
from damperfit.identification.fit_setting import minimised
from damperfit.recording import Trace
from damperfit.simulation import SolverOptions, simulate, sine_motion
from damperfit.uncertainty import Assessment, assess, reconsider
from tests.identification.rig import (
    NAMES,
    OMEGA,
    is_near,
    recorded,
    short_trace,
    short_traces,
    trace,
)

FREE = ("r_m1", "r_m2", "k_e")
KNOWN = {"r_m3": 2.597e6, "f_f": 50.0}
PAPER_BARS = {"r_m1": 1e-3, "r_m2": 3e-3, "k_e": 1e-2, "r_m3": 1e-2, "f_f": 2e-2}
THREE = FitOptions("plain", FREE, KNOWN)


@pytest.mark.parametrize("setting", [1, 10, 20])
@pytest.mark.parametrize("factor", [0.3, 3.0])
def test_noise_free_recovery_from_far_starts(setting: int, factor: float) -> None:
    truth = reference_parameters(setting)
    start = truth.replace({name: factor * getattr(truth, name) for name in FREE})
    log = short_trace(setting, duration=4.0)
    block = Block(PURDY_DAMPER, (log,), FREE, SolverOptions(tolerance=1e-2))
    assert is_near(minimised(block, start).values, truth, r_m1=1e-6, r_m2=1e-6, k_e=1e-4)


@pytest.mark.parametrize(
    "settings",
    [(1, 6, 12, 20), pytest.param(tuple(range(1, 21)), marks=pytest.mark.slow, id="all")],
)
def test_paper_procedure_recovers_all_settings_from_noisy_logs(settings) -> None:
    # 4 N and 8 um rms at 1 kHz. The scatter of K_e is 0.55 % at setting 1 (measured over seeds),
    # so that its bar of 1 % is below two standard errors there; this seed is an ordinary one.
    campaign = identify(short_traces(settings, noise=4.0, duration=10.0), PURDY_DAMPER, jobs=2)
    assert [fit.setting for fit in campaign.fits] == list(settings)
    assert campaign.warnings == ()
    assert campaign.is_complete
    for fit in campaign.fits:
        assert fit.outcome is Outcome.CONVERGED
        assert is_near(fit.parameters, reference_parameters(fit.setting), **PAPER_BARS)
        assert fit.mse_percent < 0.01
        assert fit.noise_floor_percent < 1.5 * fit.mse_percent
        assert fit.cavitation.fraction == 0.0
        # Onset lies at 2.597e6/0.85: the paper's "about 15 %".
        assert fit.cavitation.r_m3_margin == pytest.approx(1 / 0.85 - 1, abs=0.025)


@pytest.mark.parametrize(
    ("gas_pressure", "setting", "free"),
    [
        (1.5e5, 15, NAMES),
        (2.5e5, 20, (*NAMES, "f_0")),
        pytest.param(0.8e5, 5, NAMES, marks=pytest.mark.slow),
        pytest.param(1.2e5, 10, (*NAMES, "f_0"), marks=pytest.mark.slow),
    ],
)
def test_a_damper_that_cavitates_is_found_from_the_closed_form(gas_pressure, setting, free) -> None:
    # The closed form knows no cavitation; the fits ended with R_m3 and f_f at nothing.
    damper = replace(PURDY_DAMPER, gas_pressure=gas_pressure)
    log = short_trace(setting, damper=damper, noise=4.0)
    (fit,) = identify([log], damper, FitOptions("plain", free)).fits
    assert fit.outcome is Outcome.CAVITATING
    assert fit.cavitation.fraction > 0.3
    bars = {"r_m1": 5e-3, "r_m2": 5e-3, "r_m3": 5e-3, "f_f": 0.02}
    assert is_near(fit.parameters, reference_parameters(setting), **bars)


def test_another_damper_with_no_number_of_the_paper() -> None:
    damper = Damper(
        rod_diameter=0.012, piston_diameter=0.036, gas_piston_diameter=0.036, chamber_1_length=0.10,
        chamber_2_length=0.11, gas_length=0.04, oil_density=850.0, gas_pressure=9.0e5,
    )  # fmt: skip
    settings = {
        3: Parameters(r_m1=9.0e3, r_m2=1.1e6, r_m3=1.6e6, k_e=7.0e8, f_f=22.0),
        4: Parameters(r_m1=1.2e4, r_m2=1.5e6, r_m3=1.6e6, k_e=6.0e8, f_f=22.0),
        7: Parameters(r_m1=1.9e4, r_m2=3.0e6, r_m3=1.6e6, k_e=8.0e8, f_f=22.0),
    }
    logs = [
        short_trace(setting, truth, damper=damper, noise=2.0, amplitude=0.02)
        for setting, truth in settings.items()
    ]
    campaign = identify(logs, damper)
    assert campaign.sharing.taken["r_m3"] == 3
    assert campaign.warnings == ()
    bars = {"r_m1": 5e-3, "r_m2": 5e-3, "r_m3": 2e-2, "f_f": 2e-2}
    for fit in campaign.fits:
        assert fit.outcome is Outcome.CONVERGED
        assert is_near(fit.parameters, settings[fit.setting], **bars)


def test_wrong_lengths_and_gas_cost_what_the_manual_says() -> None:
    lengths = ("chamber_1_length", "chamber_2_length")
    longer = {name: 1.1 * getattr(PURDY_DAMPER, name) for name in lengths}
    log = short_trace(10, duration=6.0)
    (fit,) = identify([log], replace(PURDY_DAMPER, **longer), THREE).fits
    assert fit.parameters.k_e == pytest.approx(1.1 * reference_parameters(10).k_e, rel=0.015)
    for factor in (0.6, 1.4):
        damper = replace(PURDY_DAMPER, gas_pressure=factor * PURDY_DAMPER.gas_pressure)
        (fit,) = identify([log], damper, FitOptions("plain", (*FREE, *KNOWN))).fits
        assert fit.mse_percent < 0.3


def test_jobs_and_order_give_the_same_bits() -> None:
    logs = short_traces([1, 2, 5, 9], noise=4.0, duration=5.0)
    one = identify(logs, PURDY_DAMPER, jobs=1)
    two = identify(logs[::-1], PURDY_DAMPER, jobs=2)
    for a, b in zip(one.fits, two.fits, strict=True):
        assert a.parameters == b.parameters
        assert (a.mse_percent, a.evaluations) == (b.mse_percent, b.evaluations)


# Cavitation: how near, where, and which gas pressure keeps the chambers full.

SOLVER = SolverOptions(tolerance=1e-2)


def at(setting: int = 10, **own: float):
    return replace(reference_parameters(setting), **own)


def examined(parameters, setting: int = 10, gas: float = 4.6e5) -> Cavitation:
    damper = replace(PURDY_DAMPER, gas_pressure=gas)
    log = trace(setting, parameters, damper=damper, duration=4.0)
    response = compare(parameters, log, damper, solver=SOLVER).response
    return examine_cavitation(parameters, [(log, response)], damper, solver=SOLVER)


def lowest(parameters, gas: float) -> float:
    """Lowest pressure in the last cycle of a clean standard test, by a tight integration."""
    motion = sine_motion(0.032, 1.5, cycles=3, sample_rate=3000)
    damper = replace(PURDY_DAMPER, gas_pressure=gas)
    return float(simulate(parameters, damper, motion).pressures[:, -2000:].min())


@pytest.mark.parametrize("setting", [1, 10, 20])
def test_onset_is_where_the_paper_has_it(setting: int) -> None:
    # Section 6.2: 2.597e6 lies about 15 % below the onset, for P_0 = 0.46 MPa.
    found = examined(at(setting), setting)
    assert 1.0 - 1.0 / (1.0 + found.r_m3_margin) == pytest.approx(0.15, abs=0.016)
    onset = examined(at(setting, r_m3=2.597e6 / 0.85), setting)
    assert onset.safe_gas_pressure == pytest.approx(4.6e5, rel=0.02)


@pytest.mark.parametrize(("r_m3", "gas"), [(2.597e6, 4.6e5), (4.0e6, 4.6e5), (2.597e6, 2.5e5)])
def test_the_safe_gas_pressure_and_the_margin_just_keep_the_chambers_full(r_m3, gas) -> None:
    truth = at(r_m3=r_m3)
    found = examined(truth, gas=gas)
    assert lowest(truth, 1.005 * found.safe_gas_pressure) > 0.0
    assert lowest(truth, 0.99 * found.safe_gas_pressure) == 0.0
    onset = r_m3 * (1.0 + found.r_m3_margin)
    assert lowest(at(r_m3=0.995 * onset), gas) > 0.0 == lowest(at(r_m3=1.01 * onset), gas)
    assert (found.r_m3_margin < 0.0) == (found.fraction > 0.0)


def test_the_lowest_pressure_is_in_chamber_2_near_the_peak_speed_of_rebound() -> None:
    found = examined(at())
    assert (found.fraction, found.chamber) == (0.0, 2)
    assert found.lowest_pressure == pytest.approx(lowest(at(), 4.6e5), rel=0.01)
    assert found.velocity > 0.28
    assert 0.0 < found.displacement < 0.015
    (words,) = describe_cavitation({10: found})
    assert words.startswith("no chamber cavitates; lowest pressure 0.63 bar absolute, in chamber 2")
    assert "R_m3 may rise by 17 %, or the gas pressure fall to 3.94 bar" in words


# Logs in which the oil does not give way: fitted like any other, K_e with a lower limit alone.

SOLVER, LIMIT = SolverOptions(tolerance=1e-2), 1.959964**2
STIFF = FitOptions("plain", ("r_m1", "r_m2", "k_e"), {"r_m3": 2.597e6, "f_f": 50.0})


def rigid(setting: int, amplitude: float, noise: float, truth: Parameters | None = None) -> Trace:
    """The log of a damper whose oil cannot be compressed; noise in N, and 2 um per N."""
    random = np.random.default_rng([1, setting])
    angle = OMEGA * np.arange(10_000) / 1000.0 + random.uniform(0.0, 2.0 * np.pi)
    x, v = amplitude * np.sin(angle), amplitude * OMEGA * np.cos(angle)
    force = incompressible_force(truth or reference_parameters(setting), PURDY_DAMPER, x, v)
    return condition(recorded(x, force, setting=setting, noises=(2e-6 * noise, noise), seed=random))


def judged(log: Trace, options: FitOptions = FitOptions()) -> tuple[Campaign, Assessment]:
    campaign = identify([log], PURDY_DAMPER, options)
    assert campaign.failures == ()
    assessment = assess(campaign, PURDY_DAMPER)
    return reconsider(campaign, assessment), assessment


@pytest.mark.parametrize(("setting", "amplitude", "noise"), [(1, 0.032, 0.0), (20, 0.003, 2.0)])
def test_rigid_oil_is_fitted_and_has_no_upper_limit(setting, amplitude, noise) -> None:
    # 13 of the 36 ended in a SimulationError, 10 at a K_e of 1e13.
    campaign, assessment = judged(rigid(setting, amplitude, noise))
    fit, truth = campaign.fits[0], reference_parameters(setting)
    assert fit.outcome is Outcome.NOT_IDENTIFIABLE
    assert fit.status["k_e"] == "not_identifiable"
    assert fit.parameters.r_m2 == pytest.approx(truth.r_m2, rel=0.1)
    assert fit.parameters.f_f == pytest.approx(50.0, rel=0.02)
    assert fit.mse_percent < 0.1
    low, high = assessment.limits(setting, "k_e")
    assert high is None
    assert 5e7 < low < fit.parameters.k_e <= 1e11
    undetermined = assessment.undetermined(campaign)
    said = next(str(one) for one in undetermined if one.values["quantity"] == "k_e")
    assert f"not identifiable upward: at least {1e-6 * low:.4g} MPa (95 %)" in said
    assert said in map(str, assessment.doubts(campaign))


def _curvature(fit: Fit) -> float:
    """(H^-1)_uu of K_e in units of N^-2, by differences of the filtered force."""
    log, columns, tight = fit.logs[0].trace, [], SolverOptions(tolerance=1e-5)
    for name in STIFF.free:
        value, step = getattr(fit.parameters, name), 1e-3
        moved = (fit.parameters.replace({name: value * math.exp(s)}) for s in (step, -step))
        up, down = (compare(y, log, PURDY_DAMPER, solver=tight).force for y in moved)
        columns.append((up - down)[log.compared] / (2.0 * step))
    jacobian = np.array(columns).T
    return float(np.linalg.inv(jacobian.T @ jacobian)[-1, -1])


@pytest.mark.parametrize(
    ("setting", "amplitude", "noise"),
    [
        (10, 0.003, 4.0),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((1, 0.01, 2.0), (20, 0.003, 4.0))),
    ],
)
def test_the_lower_limit_is_where_the_misfit_has_risen_by_a_95_percent_limit(
    setting, amplitude, noise
) -> None:
    campaign, assessment = judged(rigid(setting, amplitude, noise), STIFF)
    fit, uncertainty = campaign.fits[0], assessment.uncertainties[0]
    low, high = assessment.limits(setting, "k_e")
    assert high is None
    place, log = uncertainty.names.index("k_e"), fit.logs[0].trace
    square = np.var(log.force[log.compared]) * log.n_samples / 100.0
    scale = _curvature(fit) / uncertainty.covariance[place, place]
    others = Block(PURDY_DAMPER, (log,), ("r_m1", "r_m2"), SOLVER)

    def held_at(k_e: float) -> float:
        """Least MSE with K_e held, by a descent of the others."""
        return minimised(others, fit.parameters.replace({"k_e": k_e})).mse_percent

    least = held_at(fit.parameters.k_e)
    rises = [scale * square * (held_at(k * low) - least) for k in (0.8, 1.0, 1.25, 1e13 / low)]
    # 95 % between two limits of which the upper one is not there: 2.5 % beyond this one.
    assert rises[1] == pytest.approx(LIMIT, rel=0.1)
    assert rises[0] > LIMIT > max(rises[2:])
