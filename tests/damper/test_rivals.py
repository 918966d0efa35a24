"""Models of the literature: known answers, slopes by every number, a slow twin of the states."""

from dataclasses import replace as with_fields

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from damperfit.damper.model import Values
from damperfit.damper.rivals import (
    BesingerCebonCole,
    Biviscous,
    BoucWen,
    Degressive,
    FourSlopes,
    HagedornWallaschek,
    KaradayiMasada,
    Kwok,
    PolynomialInStrokeAndSpeed,
    RestoringForceSurface,
    Rival,
    SuraceWordenTomlinson,
)
from damperfit.errors import SimulationError
from damperfit.simulation import Motion, simulate, sine_motion

MOTION = sine_motion(0.032, 1.5, cycles=2, sample_rate=2000)
PEAK_SPEED = 0.032 * 2.0 * np.pi * 1.5

# Numbers of an ordinary car damper; polynomials have 1, 1/2, 1/3, ... in units of their size.
NUMBERS: dict[str, dict[str, float]] = {
    "linear": {"c": 2e3},
    "bilinear": {"c_r": 3e3, "c_b": 1.5e3},
    "degressive": {"c_r": 8e3, "v_r": 0.2, "c_b": 3e3, "v_b": 0.4, "f_f": 20.0},
    "four_slopes": {
        "c_r1": 8e3, "c_r2": 1.5e3, "v_r": 0.1, "c_b1": 4e3, "c_b2": 9e2, "v_b": 0.07, "f_f": 20.0,
    },
    "karadayi_masada": {"k_s": 1e6, "play": 5e-4, "c_r": 4e3, "c_b": 2e3},
    "hagedorn_wallaschek": {
        "k_s": 1e6, "play": 5e-4, "c_r": 3e3, "c_b": 1e3, "q_r": 60.0, "q_b": 40.0, "k": 900.0,
        "f_f": 20.0,
    },
    "besinger_cebon_cole": {
        "k_s": 8e5, "c_r1": 9e3, "c_r2": 2e3, "c_b1": 5e3, "c_b2": 1e3, "p_r": 400.0, "p_b": 200.0,
        "f_f": 20.0,
    },
    "surace_worden_tomlinson": {
        "k_s": 1e6, "half_length": 0.06, "q_r": 120.0, "q_b": 80.0, "f_f": 20.0,
    },
    "bouc_wen": {
        "alpha": 300.0, "rho": 2e3, "sigma": 1.2, "n": 1.5, "c_r": 3e3, "c_b": 1e3, "k": 900.0,
    },
    "biviscous": {"c_pr": 2e4, "v_0": 0.01, "c_r": 2e3, "c_b": 1e3, "f_r": 500.0, "f_b": 300.0},
    "kwok": {"c": 1e3, "k": 900.0, "alpha": 400.0, "beta": 20.0, "delta": 0.4},
}  # fmt: skip
for of_model in NUMBERS.values():
    of_model["f_0"] = 30.0


def values_of(model: Rival) -> Values:
    numbers = NUMBERS.get(model.name)
    if numbers is None:
        numbers = {one.name: 0.1 * one.size / (k + 1) for k, one in enumerate(model.quantities)}
    return model.values(numbers)


def force(model: Rival, values: Values, motion: Motion = MOTION) -> np.ndarray:
    return simulate(values, model, motion).force


def at(model: Rival, velocity: float, displacement: float = 0.0, **changes: float) -> float:
    """Return the force at one steady velocity."""
    n = 3
    motion = Motion(1e-3, np.full(n, displacement), np.full(n, velocity))
    return float(force(model, values_of(model).replace(changes), motion)[-1])


def test_known_answers_of_the_curves() -> None:
    assert at(Degressive(), 0.2) == pytest.approx(8e3 * 0.2 / 2.0 + 20.0 + 30.0)
    assert at(Degressive(), -0.4) == pytest.approx(-3e3 * 0.4 / 2.0 - 20.0 + 30.0)
    assert at(FourSlopes(), 0.1) == pytest.approx(800.0 + 50.0)
    assert at(FourSlopes(), 0.3) == pytest.approx(800.0 + 300.0 + 50.0)
    assert at(FourSlopes(), -0.17) == pytest.approx(-280.0 - 90.0 - 20.0 + 30.0)
    assert at(Kwok(), 0.1, 0.01) == pytest.approx(100.0 + 9.0 + 400.0 * np.tanh(2.4) + 30.0)
    assert at(Kwok(), 0.1, -0.01) == pytest.approx(100.0 - 9.0 + 400.0 * np.tanh(1.6) + 30.0)


def test_the_bi_viscous_branches_lie_apart_by_twice_v_0() -> None:
    v = np.linspace(-0.4, 0.4, 801)
    up = force(Biviscous(), values_of(Biviscous()), Motion(1e-3, np.zeros(801), v))
    down = force(Biviscous(), values_of(Biviscous()), Motion(1e-3, np.zeros(801), v[::-1]))[::-1]
    crossing = [float(np.interp(30.0, branch, v)) for branch in (up, down)]
    assert crossing == pytest.approx([0.01, -0.01], abs=1e-6)
    assert up[-1] == pytest.approx(2e3 * 0.4 + 500.0 + 30.0)
    assert down[0] == pytest.approx(-1e3 * 0.4 - 300.0 + 30.0)


def test_polynomials_are_the_sums_they_say() -> None:
    model = PolynomialInStrokeAndSpeed()
    zero = dict.fromkeys(model.names, 0.0)
    one = {**zero, "b_12": 5.0, "b_00": 7.0}
    assert at(model, 0.3, 0.02, **one) == pytest.approx(7.0 + 5.0 * 0.02 * 0.09)
    surface = with_fields(RestoringForceSurface(), half_stroke=0.04, top_speed=0.6)
    zero = dict.fromkeys(surface.names, 0.0)
    x, v = 0.5, 0.25  # T_2(x) T_3(v)
    expected = 9.0 * (2 * x**2 - 1) * (4 * v**3 - 3 * v)
    assert at(surface, 0.6 * v, 0.04 * x, **{**zero, "c_23": 9.0}) == pytest.approx(expected)


def dashpot_speed(numbers: dict[str, float], pull: float) -> float:
    """Return the speed of the dashpot, by the law that each path's force is p + c w + (q w)^2."""
    k, sign = ("r", 1.0) if pull > 0.0 else ("b", -1.0)
    speed = 0.0
    paths = [("", f"c_{k}"), ("", f"c_{k}1"), (f"p_{k}", f"c_{k}2")]
    if f"q_{k}" in numbers:
        paths = [("", f"c_{k}")]
    for opening, damping in paths:
        c, q = numbers.get(damping, 0.0), numbers.get(f"q_{k}", 0.0)
        beyond = abs(pull) - numbers.get(opening, 0.0)
        if beyond <= 0.0 or c + q == 0.0:
            continue
        roots = np.roots([q * q, c, -beyond]) if q else np.array([beyond / c])
        speed += float(np.max(np.real(roots)))
    return sign * speed


@pytest.mark.parametrize(
    "kind", [KaradayiMasada, HagedornWallaschek, BesingerCebonCole, SuraceWordenTomlinson]
)
def test_elastic_dashpots_agree_with_radau(kind: type[Rival]) -> None:
    model = kind()
    numbers = NUMBERS[model.name]
    length = numbers.get("half_length")

    def pull(e: float) -> float:
        return numbers["k_s"] * np.sign(e) * max(abs(e) - 0.5 * numbers.get("play", 0.0), 0.0)

    def rate(t: float, e: np.ndarray) -> list[float]:
        x = 0.032 * np.sin(2.0 * np.pi * 1.5 * t)
        v = PEAK_SPEED * np.cos(2.0 * np.pi * 1.5 * t)
        stiffer = length**2 / (length**2 - x**2) if length else 1.0
        return [stiffer * (v - dashpot_speed(numbers, pull(e[0])))]

    times = MOTION.interval * np.arange(round(1.0 / MOTION.interval))
    how = {"method": "Radau", "rtol": 1e-8, "atol": 1e-12, "max_step": 2e-3}
    twin = solve_ivp(rate, (0.0, 1.0), [0.0], t_eval=times, **how)
    motion = MOTION.until(0, len(times))
    own = values_of(model)
    own = own.replace({name: 0.0 for name in ("k", "f_f", "f_0") if name in model.names})
    found = force(model, own, motion)
    expected = np.array([pull(e) for e in twin.y[0]])
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.02
    assert np.max(np.abs(found - expected)) < 1.0


def test_bouc_wen_agrees_with_radau() -> None:
    q = NUMBERS["bouc_wen"]

    def rate(t: float, z: np.ndarray) -> list[float]:
        v = PEAK_SPEED * np.cos(2.0 * np.pi * 1.5 * t)
        grip = q["sigma"] * abs(v) * np.sign(z[0]) - (q["sigma"] - 1.0) * v
        return [q["rho"] * (v - grip * abs(z[0]) ** q["n"])]

    times = MOTION.interval * np.arange(2001)
    twin = solve_ivp(
        rate, (0.0, times[-1]), [0.0], method="Radau", rtol=1e-8, atol=1e-10, t_eval=times
    )
    alone = values_of(BoucWen()).replace(alpha=1.0, c_r=0.0, c_b=0.0, k=0.0, f_0=0.0)
    found = force(BoucWen(), alone)[:2001]
    assert np.max(np.abs(found - twin.y[0])) < 5e-3
    assert np.max(np.abs(found)) <= 1.0 + 1e-12


def test_a_tube_shorter_than_the_stroke_is_refused() -> None:
    model = SuraceWordenTomlinson()
    force(model, values_of(model).replace(half_length=0.0321))
    with pytest.raises(SimulationError):
        force(model, values_of(model).replace(half_length=0.0319))
