"""How near does a fit of any motion come, over dampers of other geometry and fresh noise?

    python -m tests.identification.accuracy_of_motions --seeds 40

Raw logs at 1 kHz with 4 N and 3 um, made by the core at a hundredth of a fit's tolerance (the
oracle takes minutes for some of them); all five parameters free. Of each motion and damper: how
many logs meet all bars (R_m1 0.2 %, R_m2 0.5 %, R_m3 1 %, K_e 2 %, f_f 3 %); the bound of Cramer
and Rao of noise on the force alone, over every sample; the errors of least squares behind the
filter, over the samples that are compared; the errors (rms, mean, two steps from the truth) of
logs; all in per cent.
"""

import argparse
from dataclasses import dataclass, replace

import numpy as np

from damperfit.conditioning import ConditionOptions, apply_filter, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.identification.fit_problem import Block, linearise
from damperfit.identification.logs import weights
from damperfit.simulation import Motion, SolverOptions, simulate
from tests.identification.rig import recorded
from tests.oracles.motions import MOTIONS, RATE

OVER = 20  # samples of the motion for each of the log
FORCE_NOISE, PLACE_NOISE = 4.0, 3e-6
BARS = {"r_m1": 0.2, "r_m2": 0.5, "r_m3": 1.0, "k_e": 2.0, "f_f": 3.0}
NAMES = tuple(BARS)
# Rod, piston, gas piston, chambers, gas column: m; gas pressure: Pa. Forces stay some hundred N.
DAMPERS = {
    "paper": PURDY_DAMPER,
    "thick": replace(
        PURDY_DAMPER, rod_diameter=0.014, piston_diameter=0.036, gas_piston_diameter=0.036,
        chamber_1_length=0.09, chamber_2_length=0.11, gas_length=0.04, gas_pressure=1.2e6,
        oil_density=850.0,
    ),
    "slim": replace(
        PURDY_DAMPER, rod_diameter=0.0125, piston_diameter=0.0245, gas_piston_diameter=0.03,
        chamber_1_length=0.15, chamber_2_length=0.12, gas_length=0.07, gas_pressure=2e6,
        oil_density=820.0,
    ),
}  # fmt: skip


def truth_of(damper, setting):
    """The reference's parameters, turned so that the annulus carries like forces."""
    area = {
        one: 0.25 * np.pi * (one.piston_diameter**2 - one.rod_diameter**2)
        for one in (damper, PURDY_DAMPER)
    }
    ratio = area[PURDY_DAMPER] * PURDY_DAMPER.oil_density / (area[damper] * damper.oil_density)
    values = reference_parameters(setting)
    own = {name: float(getattr(values, name) * ratio**2) for name in ("r_m2", "r_m3")}
    return replace(values, r_m1=float(values.r_m1 * ratio**1.5), **own)


def made(drive, truth, damper, n, *, sensitivities=()):
    """Displacement and response at the log's samples; between them the core sees every corner."""
    rate = OVER * RATE
    fine = np.arange(n * OVER) / rate
    x = np.array([drive.displacement(t) for t in fine.tolist()])
    v = np.array([drive.velocity(t) for t in fine.tolist()])
    jumps = []
    for corner in sorted({one for one in drive.corners if 0.0 < one < fine[-1]}):
        speeds = [drive.velocity(corner + one) for one in (-1e-9, 1e-9)]
        at = corner * rate
        if abs(at - round(at)) < 1e-5:  # the sample belongs to what follows
            at = round(at)
            v[at] = speeds[1]
        if abs(speeds[1] - speeds[0]) > 1e-6:
            jumps.append((at, drive.displacement(corner), *speeds))
    motion = Motion(1.0 / rate, x, v, jumps=np.array(jumps).reshape(-1, 4))
    tight = SolverOptions(tolerance=1e-4)
    response = simulate(truth, damper, motion, sensitivities=sensitivities, options=tight)
    rows = [response.force, *response.sensitivities.values()]
    return x[::OVER], np.stack(rows)[:, ::OVER]


def traced(x, force, setting, seed):
    """The conditioned log with noise."""
    noises = PLACE_NOISE, FORCE_NOISE
    log = recorded(x, force, RATE, setting=setting, noises=noises, seed=seed)
    return condition(log, ConditionOptions(centre=0.0))


@dataclass(frozen=True)
class Errors:
    """In per cent, by `NAMES`: the least there are, those of least squares, those of logs."""

    least: np.ndarray  # (5,)
    behind_filter: np.ndarray  # (5,)
    of_logs: np.ndarray  # (seeds, 5)


def errors_of(motion, name, *, setting=10, seeds=range(40)):
    """Errors of one motion and damper; `motion` is a name or makes a drive."""
    damper, truth = DAMPERS[name], truth_of(DAMPERS[name], setting)
    drive = MOTIONS[motion]() if isinstance(motion, str) else motion()
    n = round(drive.duration * RATE)
    x, (force, *slopes) = made(drive, truth, damper, n, sensitivities=NAMES)
    slopes = np.array([row * getattr(truth, n) for n, row in zip(NAMES, slopes, strict=True)])
    least = 100.0 * FORCE_NOISE * np.sqrt(np.diag(np.linalg.inv(slopes @ slopes.T)))
    logs = [traced(x, force, setting, seed) for seed in seeds]
    of_logs = [_off(trace, damper, truth) for trace in logs]
    return Errors(least, _behind_filter(logs[0], slopes), np.array(of_logs))


def _behind_filter(trace, slopes):
    first = round(trace.start_time * RATE)
    kept = slopes[:, first : first + len(trace.force)]
    weight = weights((trace,))[0]
    spread = np.zeros(kept.shape[1])
    spread[trace.compared] = 1.0 if weight is None else weight
    rows = apply_filter(trace.model_filter, kept) * spread
    # A zero-phase filter is its own transpose.
    answer = apply_filter(trace.model_filter._replace(bridged=()), rows * spread)
    answer = np.linalg.inv(rows @ rows.T) @ answer
    return 100.0 * FORCE_NOISE * np.sqrt(np.sum(answer**2, axis=1))


def step_from(truth, trace, damper):
    """The Gauss-Newton step from the truth to what a log tells, of ln y."""
    block = Block(damper, (trace,), NAMES, SolverOptions(tolerance=1e-2))
    residuals, slopes = linearise(block, truth)
    return np.linalg.lstsq(slopes, -residuals, rcond=None)[0]


def _off(trace, damper, truth):
    at = truth
    for _ in range(2):
        step = step_from(at, trace, damper)
        at = at.replace({n: getattr(at, n) * np.exp(d) for n, d in zip(NAMES, step, strict=True)})
    return [100.0 * np.log(getattr(at, n) / getattr(truth, n)) for n in NAMES]


def _show_least(motion, name, setting, seeds):
    seen = errors_of(motion, name, setting=setting, seeds=seeds)
    met = np.all(np.abs(seen.of_logs) <= list(BARS.values()), axis=1)
    print(f"{motion}, {name}: {np.count_nonzero(met)} of {len(seeds)} meet all bars")
    rows = {
        "least": seen.least,
        "behind the filter": seen.behind_filter,
        "of logs, rms": np.sqrt(np.mean(seen.of_logs**2, axis=0)),
        "of logs, mean": np.mean(seen.of_logs, axis=0),
    }
    for words, row in rows.items():
        print(f"  {words:20s}{''.join(f'{one:+9.3f}' for one in row)}", flush=True)


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--first", type=int, default=5000, help="seed")
    parser.add_argument("--settings", default="5,10,15")
    parser.add_argument("--motions", default="sweep,steps,road,two triangles")
    parser.add_argument("--dampers", default=",".join(DAMPERS))
    given = parser.parse_args()
    seeds = range(given.first, given.first + given.seeds)
    for motion in given.motions.split(","):
        for name in given.dampers.split(","):
            for setting in map(int, given.settings.split(",")):
                _show_least(motion, name, setting, seeds)


if __name__ == "__main__":
    main()
