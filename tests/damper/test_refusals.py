"""What is no damper and no motion is refused in one sentence, from Python as from TOML."""

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Damper
from damperfit.damper.valve_dampers import VALVE_RANGES, Monotube
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.simulation import Motion, sine_motion, triangle_motion

# The limits as numbers, so that a moved one fails: name, lowest, highest.
LIMITS = [
    ("rod_diameter", 1e-3, 0.5),
    ("piston_diameter", 2e-3, 1.0),
    ("gas_piston_diameter", 2e-3, 1.0),
    ("chamber_1_length", 2e-3, 5.0),
    ("chamber_2_length", 2e-3, 5.0),
    ("gas_length", 1e-3, 5.0),
    ("oil_density", 500.0, 2000.0),
    ("gas_pressure", 1e4, 1e8),
    ("gas_exponent", 1.0, 1.67),
    ("ambient_pressure", 0.0, 1e7),
]
OF_VALVES = [
    ("rod_diameter", 1e-3, 0.5),
    ("piston_diameter", 2e-3, 1.0),
    ("chamber_1_length", 2e-3, 5.0),
    ("chamber_2_length", 2e-3, 5.0),
    ("oil_density", 500.0, 2000.0),
    ("gas_pressure", 1e4, 1e8),
    ("gas_volume", 1e-8, 1.0),
    ("gas_exponent", 1.0, 1.67),
    ("ambient_pressure", 0.0, 1e7),
]
# In between, so that rod and piston fit each other.
WIDE = replace(PURDY_DAMPER, piston_diameter=0.9)
THIN = replace(PURDY_DAMPER, rod_diameter=1.5e-3)


def _around(name: str) -> Damper:
    """A damper in which one diameter may go to both of its ends."""
    return WIDE if name == "rod_diameter" else THIN if name == "piston_diameter" else PURDY_DAMPER


def _one_sentence(error: BaseException) -> str:
    text = str(error)
    assert len(text.splitlines()) == 1
    assert "found" in text
    assert "expected" in text
    return text


@pytest.mark.parametrize(("name", "low", "high"), OF_VALVES)
def test_a_damper_of_valves_has_the_same_limits(name, low, high) -> None:
    assert [one for one, *_ in OF_VALVES] == list(VALVE_RANGES)
    apart = {"rod_diameter": ("piston_diameter", 0.9), "piston_diameter": ("rod_diameter", 1.5e-3)}
    around = replace(Monotube(), **dict([apart[name]] if name in apart else []))
    for value in (low, high):
        assert getattr(replace(around, **{name: value}), name) == value
    for value in (low * (1 - 1e-9) - 1e-12, high * (1 + 1e-9), math.nan):
        with pytest.raises(ConfigurationError, match=rf"^{name}: ") as caught:
            replace(around, **{name: value})
        _one_sentence(caught.value)


@pytest.mark.parametrize(("name", "low", "high"), LIMITS)
def test_a_file_is_refused_where_python_is_and_told_where(tmp_path, name, low, high) -> None:
    path = tmp_path / "mine.toml"
    base = _around(name)
    diameters = f"rod_diameter = {base.rod_diameter!r}\npiston_diameter = {base.piston_diameter!r}"
    others = [line for line in diameters.splitlines() if not line.startswith(name)]
    for value in (low * (1 - 1e-9) or -1e-9, high * (1 + 1e-9), math.nan):
        path.write_text("\n".join(["[damper]", *others, f"{name} = {value!r}", ""]))
        with pytest.raises(ConfigurationError, match=rf"mine\.toml:\d: damper\.{name}: ") as caught:
            load_configuration(path)
        assert len(str(caught.value).splitlines()) == 1
    for value in (low, high):
        # A pressure near nothing must be declared to be absolute.
        text = f'"{value!r}Paa"' if name == "gas_pressure" else repr(value)
        path.write_text("\n".join(["[damper]", *others, f"{name} = {text}", ""]))
        assert getattr(load_configuration(path).damper, name) == value


STILL = np.zeros(5)
MOTIONS = {
    "two lengths": (1e-3, np.zeros(4), STILL, r"shape \(4,\) and velocity of shape \(5,\)"),
    "two axes": (1e-3, np.zeros((2, 2)), np.zeros((2, 2)), r"shape \(2, 2\)"),
    "no sample": (1e-3, np.zeros(0), np.zeros(0), "one sample or more"),
    "NaN in x": (1e-3, np.array([0.0, math.nan, 0.0, 0.0, 0.0]), STILL, "displacement .* sample 1"),
    "infinite v": (1e-3, STILL, np.array([0.0, 0.0, 0.0, 0.0, -math.inf]), "velocity .* sample 4"),
    "no interval": (0.0, STILL, STILL, "interval above 0, found 0 s"),
    "backwards": (-1e-3, STILL, STILL, "found -0.001 s"),
    "NaN interval": (math.nan, STILL, STILL, "found nan s"),
    "endless interval": (math.inf, STILL, STILL, "found inf s"),
}


@pytest.mark.parametrize("case", MOTIONS)
def test_what_is_no_motion_is_refused(case) -> None:
    interval, x, v, says = MOTIONS[case]
    with pytest.raises(SimulationError, match=says) as caught:
        Motion(interval, x, v)
    assert len(str(caught.value).splitlines()) == 1


WAVE = {"amplitude": 0.032, "frequency": 1.5, "cycles": 2.0, "sample_rate": 1000.0}


@pytest.mark.parametrize("wave", [sine_motion, triangle_motion])
@pytest.mark.parametrize("name", WAVE)
def test_a_wave_needs_numbers_above_zero(wave, name) -> None:
    bad = [math.nan, math.inf] if name == "amplitude" else [0.0, -1.0, math.nan, math.inf]
    for value in bad:
        with pytest.raises(ConfigurationError, match=f"^{name}: expected a finite") as caught:
            _wave(wave, WAVE | {name: value})
        _one_sentence(caught.value)
    assert len(_wave(wave, WAVE).displacement) == 1334
    least = 0.0 if name == "amplitude" else 1e-3 * WAVE[name]
    assert len(_wave(wave, WAVE | {name: least}).displacement) >= 1


def _wave(wave, values) -> Motion:
    amplitude, frequency = values["amplitude"], values["frequency"]
    return wave(amplitude, frequency, cycles=values["cycles"], sample_rate=values["sample_rate"])
