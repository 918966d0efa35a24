"""A damper whose oil was not always equally warm: its law, its slopes, what it refuses."""

import math
import pickle
from dataclasses import asdict, replace

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.damper.rivals import BoucWen, Linear
from damperfit.damper.temperature_law import BETA, WithTemperature, at_temperature
from damperfit.damper.valve_dampers import TwinTube
from damperfit.errors import ConfigurationError
from damperfit.simulation import Motion, SolverOptions, simulate
from tests.damper.test_valve_dampers import VALVES

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


def test_it_has_what_its_damper_has_and_one_quantity_more() -> None:
    model, values = temperature_law("twin_tube")
    assert model.quantities == (*model.damper.quantities, BETA)
    assert (model.name, model.kinks, model.rebound) == ("twin_tube", 2e-5, model.damper.rebound)
    assert model.filled_to(9e5).gas_pressure == 9e5
    assert model.plain is model.damper
    assert model.sentence.endswith(
        "rebound_slope and compression_slope and return_slope and drag are those at 26 degC"
    )
    assert "the mean of the logs" in replace(model, reference=math.nan).sentence
    again, numbers = pickle.loads(pickle.dumps((model, values)))  # noqa: S301 - our own
    assert again == model
    assert numbers == values


# What it says itself; all else that a model says of itself is its damper's.


def test_what_temperature_does_nothing_to_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="nothing of the model 'bouc_wen' is a viscous"):
        WithTemperature(BoucWen(), 26.0)
    with pytest.raises(ConfigurationError, match="do not follow a temperature; fit logs of"):
        at_temperature(PURDY_DAMPER, 40.0)
    assert at_temperature(temperature_law("linear")[0], 40.0).oil_temperature == 40.0
