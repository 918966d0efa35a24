"""Figures that module texts and the manual tell in passing, each measured anew.

Those of findings are in `tests/conditioning/limits.py`; those of whole campaigns are commands, in
the manual's page `proof`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from damperfit.conditioning import ConditionOptions, apply_filter, condition, design_filter
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.identification.fit_problem import FitProblem, linearise
from damperfit.identification.mean_cycle import between_samples
from damperfit.recording import Recording
from damperfit.simulation import (
    SolverOptions,
    characterise,
    simulate,
    sine_motion,
    triangle_motion,
)  # fmt: skip
from damperfit.synthetic.steady import steady_cycle
from tests.conditioning.test_skew import late_log
from tests.identification.rig import trace
from tests.oracles.motions import logged

SETTINGS = (1, 10, 20)
THREE = FitOptions("plain", ("r_m1", "r_m2", "k_e"), {"r_m3": 2.597e6, "f_f": 50.0})


def fitted(log, damper=PURDY_DAMPER, options=THREE):
    return identify([log], damper, options).fits[0]


@pytest.mark.parametrize(("samples", "least", "most"), [(33, 40.0, 55.0), (333, 0.3, 0.6)])
def test_a_cycle_of_few_samples_tells_forces_coarsely(samples, least, most) -> None:
    """`queries/one_simulation.py`: the force at 0.05 m/s, up to 50 and 0.5 N off."""
    off = []
    for n in SETTINGS:
        found = []
        for rate in (1.5 * samples, 1.5 * 10_000):
            motion = sine_motion(0.032, 1.5, cycles=2, sample_rate=rate)
            response = simulate(reference_parameters(n), PURDY_DAMPER, motion)
            (at,) = characterise(response, 1.5, speeds=(0.05,)).speed_forces
            found.append(at.rebound)
        off.append(abs(found[0] - found[1]))
    assert least <= max(off) < most


def test_the_root_of_valve_1_is_negative_for_a_moment() -> None:
    """`damper/purdy/parameters.py`: P_1 < P_3 for 0.1 to 0.4 % of a cycle."""
    motion = sine_motion(0.032, 1.5, cycles=2, sample_rate=30_000.0)
    shares = []
    for n in range(1, 21):
        p = simulate(reference_parameters(n), PURDY_DAMPER, motion).pressures[:, 20_000:]
        shares.append(100.0 * float(np.mean(p[0] < p[2])))
    assert min(shares) == pytest.approx(0.1, abs=0.03)
    assert max(shares) == pytest.approx(0.4, abs=0.04)


def test_values_between_samples_are_those_of_a_wave() -> None:
    """`identification/settled.py`: 2e-5 at a tenth of the sample rate."""
    at = np.arange(100.0)
    wave = np.sin(0.2 * np.pi * at)
    between = np.linspace(20.0, 80.0, 601)
    off = between_samples(wave[np.newaxis], between)[0] - np.sin(0.2 * np.pi * between)
    assert np.max(np.abs(off)) == pytest.approx(2e-5, rel=0.3)


@pytest.mark.parametrize(("longer", "more"), [(1.1, 1.1), (0.9, 0.9)])
def test_a_wrong_length_is_a_wrong_modulus(longer, more) -> None:
    """The manual's page `model`: lengths 10 % too long, K_e 10 % too high."""
    damper = replace(
        PURDY_DAMPER,
        chamber_1_length=longer * PURDY_DAMPER.chamber_1_length,
        chamber_2_length=longer * PURDY_DAMPER.chamber_2_length,
    )
    k_e = fitted(trace(10, duration=6.0), damper).parameters.k_e
    assert k_e / reference_parameters(10).k_e == pytest.approx(more, abs=0.015)


@pytest.mark.one_in(3)
@pytest.mark.parametrize("factor", [0.6, 1.4])
@pytest.mark.parametrize("setting", SETTINGS)
def test_a_wrong_gas_pressure_is_fitted_well(setting, factor) -> None:
    """The manual's page `model`: 40 % off, the MSE is 0.3 % or less."""
    damper = replace(PURDY_DAMPER, gas_pressure=factor * PURDY_DAMPER.gas_pressure)
    five = FitOptions("plain", ("r_m1", "r_m2", "r_m3", "k_e", "f_f"))
    assert fitted(trace(setting, duration=6.0), damper, five).mse_percent <= 0.3


def test_a_delay_of_two_milliseconds_halves_the_modulus() -> None:
    """The manual's page `logs`: at setting 1, with an excellent MSE."""
    fit = fitted(condition(late_log(1, 0.002)))
    assert fit.parameters.k_e / reference_parameters(1).k_e == pytest.approx(0.5, abs=0.07)
    assert fit.mse_percent < 1.0


@pytest.mark.slow
def test_what_a_millimetre_of_mid_stroke_costs_on_a_road() -> None:
    """The manual's page `logs`: R_m3 2 %, the gas force 0.8 N, as 0.6 % of gas pressure."""
    log = logged("road", 10, force_noise=0.0, displacement_noise=0.0)
    seen = []
    for centre in (0.0, 1e-3):
        problem = FitProblem(
            PURDY_DAMPER, (condition(log, ConditionOptions(centre=centre)),),
            ("r_m1", "r_m2", "r_m3", "k_e", "f_f"), SolverOptions(tolerance=1e-3),
        )  # fmt: skip
        residuals, slopes = linearise(problem, reference_parameters(10))
        seen.append(np.linalg.lstsq(slopes, -residuals, rcond=None)[0][2])
    assert 100.0 * abs(seen[1] - seen[0]) == pytest.approx(2.0, abs=0.5)


def test_what_the_filter_takes_off_a_triangle() -> None:
    """`conditioning/drive.py`: an eighth of the velocity, and next to nothing of a sine's."""
    design = design_filter("zero_phase", 30.0, sample_rate=1000.0)
    lost = []
    for motion in (
        triangle_motion(0.032, 0.2 / (4.0 * 0.032), cycles=9, sample_rate=1000.0),
        sine_motion(0.032, 1.5, cycles=9, sample_rate=1000.0),
    ):
        inside = slice(1000, 5000)
        taken = motion.velocity - apply_filter(design, motion.velocity)
        lost.append(float(np.std(taken[inside]) / np.std(motion.velocity[inside])))
    assert lost[0] == pytest.approx(0.125, abs=0.01)
    assert lost[1] < 3e-3


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "least", "most"), [(500, 0.25, 0.35), (1000, 0.05, 0.07)])
def test_what_an_analogue_filter_in_the_rig_costs(rate, least, most) -> None:
    """`conditioning/behind_filter.py`: up to 0.3 % of a parameter at 500 Hz, 0.06 % at 1 kHz."""
    truth, fast = reference_parameters(10), 50_000
    cycle = steady_cycle(truth, PURDY_DAMPER, amplitude=0.032, frequency=1.5)
    phase = 1.5 * np.arange(10 * fast) / fast + 0.17
    sections = butter(4, 30.0, fs=fast, output="sos")
    first, every = 2 * fast, fast // rate
    x, f = (
        sosfilt(sections, one)[first::every]
        for one in (cycle.displacement(phase), cycle.force(phase))
    )
    log = Recording("log.csv", "", "", 10, np.arange(len(x)) / rate, x, f)
    five = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
    seen = condition(log, ConditionOptions(rig_filter="causal"))
    fit = fitted(seen, options=FitOptions("plain", five))
    off = [100.0 * abs(getattr(fit.parameters, one) / getattr(truth, one) - 1.0) for one in five]
    assert least <= max(off) < most, off
