"""Do intervals hold the truth of a damper whose seals turn in another form than the law's?

    python -m tests.uncertainty.drag_coverage --seeds 60      # a minute of the processor

A twin tube of three speeds in one log, drag of the seals freed. Its friction turns like the
hyperbolic tangent of the speed over 1 mm/s; the law has it turn at once, or in a straight line
(`turning_speed`). Each line: how many 95 % intervals hold, by noise alone and with what the model
misses.
"""

import argparse
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.mounting import Friction, Mounting
from damperfit.damper.valve_dampers import TwinTube
from damperfit.identification import FitOptions, identify
from damperfit.identification.options import GivenStart
from damperfit.recording import Recording
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.tested.setting import Setting
from damperfit.uncertainty import assess

RATE, AMPLITUDE = 500.0, 0.02
NAMES = (
    "rebound_bleed", "rebound_opening", "rebound_slope",
    "compression_bleed", "compression_opening", "compression_slope", "f_f", "drag",
)  # fmt: skip
SHARP = TwinTube(
    rod_diameter=0.0126, piston_diameter=0.0323, chamber_1_length=0.085, chamber_2_length=0.085,
    oil_density=850.0, gas_pressure=4.06e5, gas_volume=3.98e-5, gas_exponent=1.3,
    mounting=Mounting("none"),
)  # fmt: skip
TURNING = replace(SHARP, friction=Friction(turning_speed="fit"))
TRUTH = {
    "rebound_bleed": 9.06e4, "rebound_opening": 3.17e5, "rebound_slope": 4.37e6,
    "compression_bleed": 6.4e4, "compression_opening": 2.8e5, "compression_slope": 5.03e6,
    "return_slope": 2.45e5, "k_e": 8.6e8, "f_f": 28.8, "drag": 23.0, "f_0": -14.9,
}  # fmt: skip


@dataclass(frozen=True)
class Seals:
    """How the friction turns, and the noise of the log."""

    # Speed of the hyperbolic tangent, m/s; 0: a straight line up to 2 mm/s, as in the law.
    within: float = 1e-3
    noise: float = 2.0  # of the force, N; of the displacement a micrometre for each

    def trace(self, seed):
        """Return a log of rest, five cycles each at 0.05, 0.13 and 0.26 m/s, and rest."""
        x, force = _without_noise(self.within)
        chance, n = np.random.default_rng(seed), len(x)
        x = x + 1e-6 * self.noise * chance.standard_normal(n)
        force = force + self.noise * chance.standard_normal(n)
        log = Recording("seals.csv", "", "", Setting.of(1), np.arange(n) / RATE, x, force)
        return condition(log, ConditionOptions(centre=0.0))


@cache
def _without_noise(within):
    """Displacement and force."""
    rest = np.zeros(round(RATE))
    parts = [rest]
    for speed in (0.05, 0.13, 0.26):
        angle = speed / AMPLITUDE / RATE
        n = round(5 * 2.0 * np.pi / angle)
        parts += [AMPLITUDE * np.sin(angle * np.arange(n)), rest]
    kernel = np.hanning(19)  # no rig leaves a rest at once
    x = np.convolve(np.concatenate(parts), kernel / kernel.sum(), mode="same")
    v = np.gradient(x, 1.0 / RATE)
    known = {**TRUTH, "f_f": 0.0 if within else TRUTH["f_f"], "turning_speed": 2e-3}
    fine, motion = SolverOptions(tolerance=1e-4), Motion(1.0 / RATE, x, v)
    force = simulate(TURNING.values(known), TURNING, motion, options=fine).force
    return x, force + TRUTH["f_f"] * np.tanh(v / within) if within else force


def errors_of(law, seals, seed):
    """ln(found/true) over the error of noise, and over that with the misfit, shape (2, 8)."""
    free = (*NAMES, "f_0", *(("turning_speed",) if law is TURNING else ()))
    start = GivenStart(named={name: TRUTH.get(name, 2e-3) for name in free})
    fixed = {name: TRUTH[name] for name in ("return_slope", "k_e")}
    options = FitOptions("plain", free=free, fixed=fixed, start=start)
    campaign = identify([seals.trace(seed)], law, options)
    (fit,), (known,) = campaign.fits, assess(campaign, law).uncertainties
    rows = []
    for name in NAMES:
        value, interval = getattr(fit.parameters, name), known.intervals[name]
        off = value * np.log(value / TRUTH[name])
        rows.append((off / interval.error, off / np.hypot(interval.error, interval.misfit)))
    return np.array(rows).T


def main() -> None:
    """Print the coverage of both laws, where the friction turns as in the law and otherwise."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=60)
    seeds = range(parser.parse_args().seeds)
    for title, law, seals in (
        ("a straight line, as in the law", TURNING, Seals(within=0.0)),
        ("hyperbolic tangent, law a straight line", TURNING, Seals()),
        ("hyperbolic tangent, law at once", SHARP, Seals()),
        ("hyperbolic tangent, law a straight line, 0.5 N of noise", TURNING, Seals(noise=0.5)),
    ):
        found = np.array([errors_of(law, seals, seed) for seed in seeds])
        held = 100.0 * np.mean(np.abs(found) < 1.96, axis=0)
        print(f"{title}: of 100 intervals hold, by noise and with the misfit")
        for name, alone, whole in zip(NAMES, *held, strict=True):
            print(f"  {name:20s} {alone:4.0f} {whole:4.0f}")


if __name__ == "__main__":
    main()
