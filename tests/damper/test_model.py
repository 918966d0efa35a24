"""Models, quantities and values; the cylinder, the reference set, starts."""

import copy
import dataclasses
import math
import pickle
from dataclasses import asdict, replace

import numpy as np
import pytest
from scipy.optimize import nnls

from damperfit.configuration.loading import load_configuration
from damperfit.damper.model import Quantity, Values, values_type
from damperfit.damper.purdy.parameters import (
    DAMPER_RANGES,
    PURDY_DAMPER,
    Damper,
    Parameters,
    incompressible_force,
    nonnegative_least_squares,
    reference_parameters,
    starting_values,
)
from damperfit.damper.rivals import BoucWen, Linear
from damperfit.damper.temperature_law import WithTemperature, at_temperature
from damperfit.damper.valve_dampers import VALVE_RANGES, Monotube, ThroughFlow, TwinTube
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.simulation import Motion, SolverOptions, simulate, sine_motion, triangle_motion
from tests import fakes
from tests.damper.test_valve_dampers import VALVES

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


def test_columns_that_are_one_another_are_shared_out_and_negative_ones_left() -> None:
    column = np.linspace(1.0, 2.0, 9)
    found = nonnegative_least_squares(np.column_stack([column, column, 0.0 * column]), 3.0 * column)
    assert found[0] + found[1] == pytest.approx(3.0)
    assert found.min() >= 0.0
    assert nonnegative_least_squares(np.eye(3), -np.ones(3)).tolist() == [0.0, 0.0, 0.0]


# What is no damper and no motion is refused in one sentence, from Python as from TOML.

# The limits as numbers, so that a moved one fails.
LIMITS = {
    "rod_diameter": (1e-3, 0.5), "piston_diameter": (2e-3, 1.0), "gas_piston_diameter": (2e-3, 1.0),
    "chamber_1_length": (2e-3, 5.0), "chamber_2_length": (2e-3, 5.0), "gas_length": (1e-3, 5.0),
    "oil_density": (500.0, 2000.0), "gas_pressure": (1e4, 1e8), "gas_volume": (1e-8, 1.0),
    "gas_exponent": (1.0, 1.67), "ambient_pressure": (0.0, 1e7),
}  # fmt: skip
# In between, so that rod and piston fit each other.
APART = {"rod_diameter": {"piston_diameter": 0.9}, "piston_diameter": {"rod_diameter": 1.5e-3}}


@pytest.mark.parametrize("name", LIMITS)
def test_a_damper_has_limits_of_which_a_file_tells_where(tmp_path, name) -> None:
    assert LIMITS.keys() == DAMPER_RANGES.keys() | VALVE_RANGES.keys()
    (low, high), path = LIMITS[name], tmp_path / "mine.toml"
    beyond = (low * (1 - 1e-9) - 1e-12, high * (1 + 1e-9), math.nan)
    for damper, ranges in ((PURDY_DAMPER, DAMPER_RANGES), (Monotube(), VALVE_RANGES)):
        if name not in ranges:
            continue
        around = replace(damper, **APART.get(name, {}))
        for value in (low, high):
            assert getattr(replace(around, **{name: value}), name) == value
        for value in beyond:
            with pytest.raises(ConfigurationError, match=rf"^{name}: expected .* found") as caught:
                replace(around, **{name: value})
            assert len(str(caught.value).splitlines()) == 1
        others = [f"{key} = {value!r}" for key, value in APART.get(name, {}).items()]
        others.insert(0, f'model = "{damper.name}"')
        for value in beyond:
            path.write_text("\n".join(["[damper]", *others, f"{name} = {value!r}", ""]))
            with pytest.raises(ConfigurationError, match=rf"mine\.toml:\d: damper\.{name}: "):
                load_configuration(path)
        # A pressure near nothing must be declared to be absolute.
        text = f'"{high!r}Paa"' if name == "gas_pressure" else repr(high)
        path.write_text("\n".join(["[damper]", *others, f"{name} = {text}", ""]))
        assert getattr(load_configuration(path).damper, name) == high


def test_a_rod_as_wide_as_the_piston_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="less than piston_diameter"):
        Monotube(rod_diameter=0.03)


STILL = np.zeros(5)


@pytest.mark.parametrize(
    ("interval", "x", "v", "says"),
    [
        (1e-3, np.zeros(4), STILL, r"shape \(4,\) and velocity of shape \(5,\)"),
        (1e-3, np.zeros((2, 2)), np.zeros((2, 2)), r"shape \(2, 2\)"),
        (1e-3, np.zeros(0), np.zeros(0), "one sample or more"),
        (1e-3, np.array([0.0, math.nan, 0.0, 0.0, 0.0]), STILL, "displacement .* sample 1"),
        (1e-3, STILL, np.array([0.0, 0.0, 0.0, 0.0, -math.inf]), "velocity .* sample 4"),
        *((one, STILL, STILL, "interval above 0") for one in (0.0, -1e-3, math.nan, math.inf)),
    ],
)
def test_what_is_no_motion_is_refused(interval, x, v, says) -> None:
    with pytest.raises(SimulationError, match=says) as caught:
        Motion(interval, x, v)
    assert len(str(caught.value).splitlines()) == 1


WAVE = {"amplitude": 0.032, "frequency": 1.5, "cycles": 2.0, "sample_rate": 1000.0}


@pytest.mark.parametrize("wave", [sine_motion, triangle_motion])
@pytest.mark.parametrize("name", WAVE)
def test_a_wave_needs_numbers_above_zero(wave, name) -> None:
    def made(**changed) -> Motion:
        known = WAVE | changed
        return wave(known.pop("amplitude"), known.pop("frequency"), **known)

    for value in [math.nan, math.inf] if name == "amplitude" else [0.0, -1.0, math.nan, math.inf]:
        with pytest.raises(ConfigurationError, match=f"^{name}: expected a finite .* found"):
            made(**{name: value})
    assert len(made().displacement) == 1334
    least = 0.0 if name == "amplitude" else 1e-3 * WAVE[name]
    assert len(made(**{name: least}).displacement) >= 1


# A damper whose oil was not always equally warm: its law, its slopes, what it refuses.

FINE = SolverOptions(tolerance=1e-4)
# A quotient of two runs holds the noise of their steps: at 1e-4 N hundreds of times a slope's.
OF_QUOTIENTS = SolverOptions(tolerance=1e-6)
NUMBERS = {
    "purdy": (PURDY_DAMPER, asdict(reference_parameters(5))),
    "twin_tube": (TwinTube(), {**VALVES, "k_s": 4e5, "drag": 12.0}),
    "linear": (Linear(), {"c": 2e3, "f_0": 12.0}),
}
EVERY = pytest.mark.parametrize("name", NUMBERS)


def motion(temperature: float | None) -> Motion:
    t = np.arange(600) / 500.0
    angle = 2.0 * np.pi * 1.5 * t
    v = 0.02 * 2.0 * np.pi * 1.5 * np.cos(angle)
    return Motion(1.0 / 500.0, 0.02 * np.sin(angle), v, temperature=temperature)


def temperature_law(name: str, beta: float = 0.012, reference: float = 26.0):
    damper, numbers = NUMBERS[name]
    own = {key: value for key, value in numbers.items() if key in damper.names}
    model = WithTemperature(damper, reference)
    return model, model.values({**own, "beta": beta})


@EVERY
@pytest.mark.parametrize("temperature", [26.0, None])
def test_at_its_reference_it_is_the_damper_itself(name: str, temperature) -> None:
    model, values = temperature_law(name)
    own = model.damper.values_type(*values.numbers[:-1])
    wanted = model.damper.names
    seen = simulate(values, model, motion(temperature), sensitivities=wanted, options=FINE)
    plain = simulate(own, model.damper, motion(None), sensitivities=wanted, options=FINE)
    np.testing.assert_array_equal(seen.force, plain.force)
    assert list(seen.sensitivities) == list(wanted)
    for one in wanted:
        np.testing.assert_array_equal(seen.sensitivities[one], plain.sensitivities[one])


@EVERY
def test_what_is_viscous_alone_falls_by_beta_and_kelvin(name: str) -> None:
    model, values = temperature_law(name)
    there = model.at_reference(values, 60.0)
    assert model.viscous
    for one in model.damper.quantities:
        factor = math.exp(-0.012 * 34.0) if one.role == "viscous" else 1.0
        assert getattr(there, one.name) == pytest.approx(factor * getattr(values, one.name))
    seen = simulate(values, model, motion(60.0), options=FINE)
    np.testing.assert_array_equal(
        seen.force, simulate(there, model.damper, motion(None), options=FINE).force
    )
    assert simulate(values, model, motion(None), options=FINE).force.max() > seen.force.max()
    warm = replace(model, temperature=60.0)  # where a motion does not tell
    np.testing.assert_array_equal(
        simulate(values, warm, motion(None), options=FINE).force, seen.force
    )


@EVERY
def test_slopes_by_every_number_are_those_of_differences(name: str) -> None:
    model, values = temperature_law(name)
    moving = [*model.viscous, "beta"]
    seen = simulate(values, model, motion(60.0), sensitivities=("beta", *moving[:-1]), options=FINE)
    assert list(seen.sensitivities) == ["beta", *moving[:-1]]
    for one in moving:
        value = getattr(values, one)
        if value == 0.0:
            continue
        step = 1e-4 * value
        ends = [
            simulate(
                values.replace({one: value + k * step}), model, motion(60.0), options=OF_QUOTIENTS
            )
            for k in (-1, 1)
        ]
        slope = (ends[1].force - ends[0].force) / (2.0 * step)
        np.testing.assert_allclose(
            seen.sensitivities[one], slope, atol=5e-3 * np.max(np.abs(slope)) + 1e-9
        )


# What it says itself; all else that a model says of itself is its damper's.


def test_what_temperature_does_nothing_to_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="nothing of the model 'bouc_wen' is a viscous"):
        WithTemperature(BoucWen(), 26.0)
    with pytest.raises(ConfigurationError, match="do not follow a temperature; fit logs of"):
        at_temperature(PURDY_DAMPER, 40.0)
    assert at_temperature(temperature_law("linear")[0], 40.0).oil_temperature == 40.0
