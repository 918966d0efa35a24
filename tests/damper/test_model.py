"""Models, quantities and values; the cylinder, the reference set, starts."""

import copy
import dataclasses
import math
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls

from damperfit.damper.model import Values, values_type
from damperfit.damper.purdy.closed_forms import incompressible_force
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Damper, Parameters
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.purdy.starting import (
    cavitation_limit,
    further_starts,
    nonnegative_least_squares,
    starting_values,
)
from damperfit.damper.quantity import Quantity
from damperfit.damper.valve_dampers import Monotube, ThroughFlow, TwinTube
from damperfit.errors import ConfigurationError
from damperfit.identification import DETECT, FitOptions, Status, identify
from tests import fakes
from tests.identification import adjusted
from tests.identification.adjusted import DAMPER, FOLLOWS, SETTINGS, log

QUANTITIES = (
    Quantity("c", "c", "damping", "viscous damping", "N s/m", (1.0, 1e6)),
    Quantity("f_f", "f_f", "friction", "Coulomb friction", "N", (1e-3, 1e4)),
)
MADE = values_type(QUANTITIES)(1.5e3, 20.0)


@pytest.mark.parametrize("values", [MADE, reference_parameters(3)], ids=["made", "paper"])
def test_values_are_frozen_ordered_and_survive_the_way_to_another_process(values: Values) -> None:
    assert values.numbers == tuple(getattr(values, name) for name in values.names)
    sent = pickle.loads(pickle.dumps(values))  # noqa: S301 - our own bytes
    assert sent == values == copy.deepcopy(values)
    assert type(sent) is type(values)
    with pytest.raises(dataclasses.FrozenInstanceError):
        values.f_f = 3.0  # type: ignore[misc]
    changed = values.replace({"f_f": 3.0})
    assert (changed.f_f, values.f_f != 3.0) == (3.0, True)
    assert changed.replace(f_f=values.f_f) == values
    assert dataclasses.asdict(values) == dict(zip(values.names, values.numbers, strict=True))


def test_a_name_that_is_none_of_the_models_is_refused_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match=r"no parameter 'f_g'; there are c, f_f\..*'f_f'"):
        MADE.replace(f_g=1.0)
    with pytest.raises(ConfigurationError, match=r"no parameter 'r_m4'"):
        PURDY_DAMPER.values(r_m4=1.0)


def test_values_of_a_model_take_the_defaults_and_miss_what_has_none() -> None:
    known = dict(zip(["r_m1", "r_m2", "r_m3", "k_e", "f_f"], range(1, 6), strict=True))
    assert PURDY_DAMPER.values(known) == Parameters(1, 2, 3, 4, 5, 0.0)
    del known["k_e"]
    with pytest.raises(ConfigurationError, match="purdy needs a value of k_e"):
        PURDY_DAMPER.values(known)


def test_one_model_loads_no_other() -> None:
    script = "import sys, damperfit.damper.model as m; m.MODELS['purdy']; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert "damperfit.damper.purdy.parameters" in loaded
    assert loaded.isdisjoint({"damperfit.damper.rivals", "damperfit.damper.valve_dampers"})


# Areas and volumes by hand, and which of them each stroke of a layout presses with.

LENGTHS = {
    "rod_diameter": 0.02, "piston_diameter": 0.04, "chamber_1_length": 0.1, "chamber_2_length": 0.2,
}  # fmt: skip
ROD, PISTON, ANNULUS = math.pi * 1e-4, math.pi * 4e-4, math.pi * 3e-4
PRESSED = {TwinTube: (ANNULUS, ROD), Monotube: (ANNULUS, ANNULUS), ThroughFlow: (ANNULUS, PISTON)}


@pytest.mark.parametrize("kind", [Damper, *PRESSED])
def test_areas_and_volumes_are_those_of_circles(kind) -> None:
    damper = kind(**LENGTHS)
    areas = damper.rod_area, damper.piston_area, damper.annulus_area
    assert areas == pytest.approx((ROD, PISTON, ANNULUS))
    volumes = damper.chamber_1_volume, damper.chamber_2_volume
    assert volumes == pytest.approx((0.1 * ANNULUS, 0.2 * PISTON))
    if kind in PRESSED:
        assert damper.pressed_areas == pytest.approx(PRESSED[kind])


# The gas of a damper with real valves: held as declared, or found by the logs of all settings.


def test_one_volume_and_one_pressure_are_found_from_all_settings() -> None:
    # Declared a third too high and a fifth too low, as from a gauge and a guess.
    wrong = replace(DAMPER, gas_pressure=1.35 * DAMPER.gas_pressure, gas_volume=4.8e-5)
    free = ("rebound_bleed", "rebound_opening", "rebound_slope", "compression_bleed", "k_e", "f_f")
    options = FitOptions(
        "joint", free=(*free, "gas_pressure", "gas_volume"), fixed={"f_0": 8.0},
        share=(DETECT,), follows=FOLLOWS,
    )  # fmt: skip
    campaign = identify(adjusted.logs(), wrong, options)
    for fit in campaign.fits:
        assert fit.parameters.gas_pressure == pytest.approx(DAMPER.gas_pressure, rel=0.01)
        assert fit.parameters.gas_volume == pytest.approx(6e-5, rel=0.02)
        assert fit.status["gas_pressure"] is fit.status["gas_volume"] is Status.SHARED
        assert fit.status["gas_exponent"] is Status.FIXED


def test_the_exponent_is_told_by_what_the_gas_does_to_the_force() -> None:
    wrong = replace(DAMPER, gas_exponent=1.0)
    fitted = identify(
        [log(SETTINGS[0], noise=0.1)], wrong,
        FitOptions("plain", free=(*adjusted.TRUTH, "gas_exponent")),
    )  # fmt: skip
    assert fitted.fits[0].parameters.gas_exponent == pytest.approx(1.3, rel=0.02)


# The synthetic reference set: two settings of the formulas of its docstring, worked out by hand.


def test_the_reference_set_follows_the_formulas():
    third, last = (reference_parameters(setting).numbers for setting in (3, 20))
    assert third == pytest.approx((15580.0, 2442805.5, 2.597e6, 463936000.0, 50.0, 0.0))
    assert last == pytest.approx((49000.0, 17e6, 2.597e6, 1077808000.0, 50.0, 0.0))


@pytest.mark.parametrize("setting", [0, 21, -1, 2.5])
def test_other_settings_are_refused(setting):
    with pytest.raises(ConfigurationError, match="1 to 20"):
        reference_parameters(setting)


# Least squares without negative values, beside SciPy's.


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("k", [1, 3, 6])
def test_least_squares_are_scipys(seed: int, k: int) -> None:
    random = np.random.default_rng([seed, k])
    columns = random.standard_normal((50, k))
    values = columns @ random.standard_normal(k) + 0.3 * random.standard_normal(50)
    expected = nnls(columns, values)[0]
    assert np.allclose(nonnegative_least_squares(columns, values), expected, atol=1e-10)


@pytest.mark.parametrize("held", ["", "r_m1", "r_m2", "r_m3", "f_f", "r_m2 f_f", "f_0"])
def test_starts_are_the_numbers_of_an_incompressible_damper_whatever_is_held(held) -> None:
    true = Parameters(1.8e4, 3.5e6, 1.5e6, 1e9, 50.0)
    one = fakes.trace(1)
    force = incompressible_force(true, PURDY_DAMPER, one.displacement, one.velocity)
    fixed = {name: getattr(true, name) for name in held.split()}
    begin = starting_values([replace(one, force=force)], PURDY_DAMPER, fixed, 1e9)
    assert begin.numbers == pytest.approx(true.numbers, rel=1e-6, abs=1e-6)


def test_a_fit_also_begins_below_the_onset_of_cavitation() -> None:
    start, one = reference_parameters(10), fakes.trace(10)
    limit = cavitation_limit([one], PURDY_DAMPER)
    for r_m3, below in ((0.5 * limit, 0.5 * limit), (3.0 * limit, limit)):
        first, *_ = further_starts(
            start.replace(r_m3=r_m3), [one], PURDY_DAMPER, PURDY_DAMPER.names
        )
        assert first.start.r_m3 == pytest.approx(below)
    assert further_starts(start, [one], PURDY_DAMPER, ("r_m1",)) == ()


def test_columns_that_are_one_another_are_shared_out_and_negative_ones_left() -> None:
    column = np.linspace(1.0, 2.0, 9)
    found = nonnegative_least_squares(np.column_stack([column, column, 0.0 * column]), 3.0 * column)
    assert found[0] + found[1] == pytest.approx(3.0)
    assert found.min() >= 0.0
    assert nonnegative_least_squares(np.eye(3), -np.ones(3)).tolist() == [0.0, 0.0, 0.0]
