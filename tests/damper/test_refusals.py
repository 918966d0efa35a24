"""What is no damper and no motion is refused in one sentence, from Python as from TOML."""

import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.configuration.loading import load_configuration
from damperfit.damper.purdy.parameters import DAMPER_RANGES, PURDY_DAMPER
from damperfit.damper.valve_dampers import VALVE_RANGES, Monotube
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.simulation import Motion, sine_motion, triangle_motion

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
