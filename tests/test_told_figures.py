"""Figures that module texts and the manual tell in passing, each measured anew."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.identification.fit_problem import Block, linearise
from damperfit.recording import Recording
from damperfit.simulation import (
    SolverOptions,
)  # fmt: skip
from damperfit.synthetic.steady import steady_cycle
from tests.identification.rig import trace
from tests.oracles.motions import logged

SETTINGS = (1, 10, 20)
THREE = FitOptions("plain", ("r_m1", "r_m2", "k_e"), {"r_m3": 2.597e6, "f_f": 50.0})


def fitted(log, damper=PURDY_DAMPER, options=THREE):
    return identify([log], damper, options).fits[0]


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


@pytest.mark.slow
def test_what_a_millimetre_of_mid_stroke_costs_on_a_road() -> None:
    """The manual's page `logs`: R_m3 2 %, the gas force 0.8 N, as 0.6 % of gas pressure."""
    log = logged("road", 10, force_noise=0.0, displacement_noise=0.0)
    seen = []
    for centre in (0.0, 1e-3):
        problem = Block(
            PURDY_DAMPER, (condition(log, ConditionOptions(centre=centre)),),
            ("r_m1", "r_m2", "r_m3", "k_e", "f_f"), SolverOptions(tolerance=1e-3),
        )  # fmt: skip
        residuals, slopes = linearise(problem, reference_parameters(10))
        seen.append(np.linalg.lstsq(slopes, -residuals, rcond=None)[0][2])
    assert 100.0 * abs(seen[1] - seen[0]) == pytest.approx(2.0, abs=0.5)


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
