"""Where do fits end that start far from the truth: speed steps, sine, sweep, road?

    python -m tests.identification.far_starts
    python -m tests.identification.far_starts --motions steps --settings 1 --names k_e --factors 100

One number at a time (`--together`: pairs of them) begins by large factors off; 4 N and 3 um of
noise at 1 kHz, all five free. An end is right where it fits no worse than the one from the truth,
within noise, and R_m1, K_e and f_f lie within 2 % of what that one found. Logs are made by the core
at a hundredth of a fit's tolerance: the oracle's integrator takes minutes for the slowest speed at
setting 1, and valleys are the model's own. Time is the processor's.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.errors import DamperfitError
from damperfit.identification import Fit, FitOptions, GivenStart, identify
from damperfit.recording import Recording
from damperfit.simulation import Motion, SolverOptions, simulate
from tests.oracles.motions import MOTIONS, RATE

NAMES = ("r_m1", "k_e", "f_f")
FACTORS = (0.01, 0.1, 10.0, 100.0)


@dataclass(frozen=True)
class End:
    """Where a fit ended, and what it cost."""

    fit: Fit
    seconds: float

    def __str__(self):
        fit = self.fit
        numbers = ", ".join(f"{n} {getattr(fit.parameters, n):.4g}" for n in fit.parameters.names)
        return (
            f"MSE {fit.mse_percent:.4g} %, {fit.outcome.value}, {fit.evaluations} evaluations, "
            f"{self.seconds:.1f} s: {numbers}"
        )


def log_of(motion, setting, *, seed=1, force_noise=4.0, displacement_noise=3e-6):
    """A raw log of a motion."""
    drive, random = MOTIONS[motion](), np.random.default_rng(seed)
    times = np.arange(round(drive.duration * RATE)) / RATE
    x = np.array([drive.displacement(t) for t in times.tolist()])
    v = np.array([drive.velocity(t) for t in times.tolist()])
    tight = SolverOptions(tolerance=1e-4)
    made = simulate(
        reference_parameters(setting), PURDY_DAMPER, Motion(1.0 / RATE, x, v), options=tight
    )
    return Recording(
        name=f"{motion}.csv",
        path=f"{motion}.csv",
        sha256="",
        setting=setting,
        time=times,
        displacement=x + displacement_noise * random.standard_normal(len(x)),
        force=made.force + force_noise * random.standard_normal(len(x)),
    )


def fitted_from(trace, start):
    """Fit one log from so far; numbers beyond what is plausible begin at the edge of it."""
    values = reference_parameters(trace.setting)
    named = {}
    for name, value in start.items():
        low, high = values.quantity(name).plausible
        named[name] = min(max(value, low), high)
    began = time.process_time()
    options = FitOptions(procedure="plain", start=GivenStart(named=named))
    (fit,) = identify([trace], PURDY_DAMPER, options).fits
    return End(fit, time.process_time() - began)


def is_right(end, best):
    """Whether a fit ended where the one from the truth did."""
    if end.fit.mse_percent > 1.001 * best.fit.mse_percent:
        return False
    pairs = ((getattr(end.fit.parameters, n), getattr(best.fit.parameters, n)) for n in NAMES)
    return all(abs(np.log(one / other)) < 0.02 for one, other in pairs)


def starts_of(truth, names, factors, *, together):
    """Yield what to start at, by name: one number at a time, or pairs of them."""
    for name in names:
        for factor in factors:
            yield {name: factor * getattr(truth, name)}
    for first, second in combinations(names, 2) if together else ():
        for one in factors:
            for other in factors:
                yield {first: one * getattr(truth, first), second: other * getattr(truth, second)}


def main():
    """Print each end, and the count of right ones."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", default="steps,sine")
    parser.add_argument("--settings", default="1,20")
    parser.add_argument("--names", default=",".join(NAMES))
    parser.add_argument("--factors", default=",".join(map(str, FACTORS)))
    parser.add_argument("--together", action="store_true")
    given = parser.parse_args()
    factors = [float(one) for one in given.factors.split(",")]
    for motion in given.motions.split(","):
        for setting in map(int, given.settings.split(",")):
            truth = reference_parameters(setting)
            trace = condition(log_of(motion, setting), ConditionOptions(centre=0.0))
            everything = {
                name: getattr(truth, name) for name in ("r_m1", "r_m2", "r_m3", *NAMES[1:])
            }
            best = fitted_from(trace, everything)
            print(f"{motion}, setting {setting}, from the truth: {best}", flush=True)
            right, seconds, n = 0, [], 0
            for start in starts_of(truth, given.names.split(","), factors, together=given.together):
                n += 1
                said = ", ".join(f"{k} x {v / getattr(truth, k):g}" for k, v in start.items())
                began = time.process_time()
                try:
                    end = fitted_from(trace, start)
                except DamperfitError as error:
                    print(f"  {said}: {time.process_time() - began:.1f} s, {error}", flush=True)
                    continue
                is_there = is_right(end, best)
                right += is_there
                seconds.append(end.seconds)
                print(f"  {'right' if is_there else 'WRONG'} {said}: {end}", flush=True)
            print(
                f"{motion}, setting {setting}: {right} of {n} right, {best.seconds:.1f} s from the "
                f"truth, {np.median(seconds):.1f} s in the middle, {max(seconds):.1f} s at most",
                flush=True,
            )


if __name__ == "__main__":
    main()
