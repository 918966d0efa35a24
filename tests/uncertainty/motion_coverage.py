"""Do 95 % intervals cover 95 of 100 on logs that are no steady sine?

    python -m tests.uncertainty.motion_coverage --motions steps,sweep,road --campaigns 100

Setting 10, 1 kHz, 4 N and 3 um of noise, all five parameters free. Each line: how many intervals of
so many hold the truth, and the errors given over the scatter found. All five parameters of a motion
err together, so that the scatter of 300 campaigns may be 10 % off in all of them at once.

`quickly_covered` does the same for a short rough road in a tenth of the time: each fit is the one
Gauss-Newton step from the truth.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.identification import FitOptions, LogFit, Sharing, identify
from damperfit.recording import Recording
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.uncertainty import assess, uncertainties
from damperfit.uncertainty.covariance import linearise_at_fit
from tests import fakes
from tests.identification.accuracy_of_motions import NAMES, step_from
from tests.oracles.motions import MOTIONS, logged, road


def deviations(motion, seed):
    """ln(found/true) of each parameter and its standard error, shape (2, 5)."""
    trace = condition(logged(motion, 10, seed=seed), ConditionOptions(centre=0.0))
    campaign = identify([trace], PURDY_DAMPER, FitOptions(procedure="plain"))
    (known,) = assess(campaign, PURDY_DAMPER).uncertainties
    found, truth = campaign.fits[0].parameters, reference_parameters(10)
    off = [np.log(getattr(found, name) / getattr(truth, name)) for name in NAMES]
    return np.array([off, [known.intervals[n].error / getattr(found, n) for n in NAMES]])


def covered(motion, campaigns, *, jobs=1):
    """How many intervals hold the truth, mean error over scatter, and the mean, by parameter."""
    with ProcessPoolExecutor(jobs) as pool:
        table = np.array(list(pool.map(partial(deviations, motion), range(campaigns))))
    return counted(table)


def counted(table):
    """The same from deviations, shape (campaigns, 2, parameters)."""
    off, errors = table[:, 0], table[:, 1]
    hits = np.count_nonzero(np.abs(off) <= 1.959964 * errors, axis=0)
    scatter = np.sqrt(np.mean(off**2, axis=0))
    return hits, np.mean(errors, axis=0) / scatter, np.mean(off, axis=0)


def quickly_covered(campaigns, *, setting=10, duration=6.0):
    """The same for one step from the truth, on a short road whose force the core has made."""
    drive, truth = road(high=6.0, duration=duration), reference_parameters(setting)
    time = np.arange(round(1000.0 * duration)) / 1000.0
    x, v = (np.array([of(t) for t in time.tolist()]) for of in (drive.displacement, drive.velocity))
    tight = SolverOptions(tolerance=1e-4)
    force = simulate(truth, PURDY_DAMPER, Motion(1e-3, x, v), options=tight).force
    plain = fakes.fit(setting, status=dict.fromkeys(NAMES, "fitted"))
    table = []
    for seed in range(campaigns):
        random, n = np.random.default_rng(seed), len(x)
        seen = (x + 3e-6 * random.standard_normal(n), force + 4.0 * random.standard_normal(n))
        log = Recording("road.csv", "road.csv", "", setting, time, *seen)
        trace = condition(log, ConditionOptions(centre=0.0))
        step = step_from(truth, trace, PURDY_DAMPER)
        found = {n: getattr(truth, n) * np.exp(d) for n, d in zip(NAMES, step, strict=True)}
        logs = (LogFit(trace, 0.001, 0.001),)
        fit = replace(plain, parameters=replace(truth, **found), logs=logs)
        (known,) = uncertainties([linearise_at_fit(fit, PURDY_DAMPER)], Sharing())
        table.append([step, [known.intervals[n].error / found[n] for n in NAMES]])
    return counted(np.array(table))


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", default="steps,sweep,road", help=f"of {', '.join(MOTIONS)}")
    parser.add_argument("--campaigns", type=int, default=50)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    print(f"held by the interval, of {given.campaigns}; error given over scatter; mean error in %")
    for motion in given.motions.split(","):
        rows = zip(NAMES, *covered(motion, given.campaigns, jobs=given.jobs), strict=True)
        cells = (f"{name} {hit} {r:.2f} {100.0 * b:+.3f}" for name, hit, r, b in rows)
        print(f"{motion:15s}" + "   ".join(cells), flush=True)


if __name__ == "__main__":
    main()
