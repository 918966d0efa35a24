"""Do 95 % intervals cover 95 of 100 on logs that are no steady sine?

    python -m tests.uncertainty.motion_coverage --motions steps,sweep,road --campaigns 100

Setting 10, 1 kHz, 4 N and 3 um of noise, all five parameters free. Each line: how many intervals of
so many hold the truth, and the errors given over the scatter found.

    python -m tests.uncertainty.motion_coverage --motions "road,rounded triangles" --steps 1500

asks whether the errors given are right, with little luck in the answer: each campaign is two
Gauss-Newton steps from the truth, where a descent ends as well, and the errors are those of 100
fits. All five parameters of a motion err together, so that the scatter of 300 campaigns may be
10 % off in all of them at once. Each line: mean error given over scatter, and how many of 100
intervals hold.

`quickly_covered` does the same as the first for a short rough road in a tenth of the time: each fit
is the one Gauss-Newton step from the truth.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, LogFit, Sharing, identify
from damperfit.identification.fit_problem import Block, linearise
from damperfit.recording import Recording
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.uncertainty import assess, uncertainties
from damperfit.uncertainty.linearisation import linearise_at_fit
from tests import fakes
from tests.oracles.motions import MOTIONS, logged, road

NAMES = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")


def deviations(motion, seed, *, setting=10):
    """ln(found/true) of each parameter and its standard error, shape (2, 5)."""
    trace = condition(logged(motion, setting, seed=seed), ConditionOptions(centre=0.0))
    campaign = identify([trace], PURDY_DAMPER, FitOptions(procedure="plain"))
    (known,) = assess(campaign, PURDY_DAMPER).uncertainties
    found, truth = campaign.fits[0].parameters, reference_parameters(setting)
    off = [np.log(getattr(found, name) / getattr(truth, name)) for name in NAMES]
    return np.array([off, [known.intervals[n].error / getattr(found, n) for n in NAMES]])


def covered(motion, campaigns, *, jobs=1):
    """How many intervals hold the truth, and mean error over scatter, by parameter."""
    with ProcessPoolExecutor(jobs) as pool:
        table = np.array(list(pool.map(partial(deviations, motion), range(campaigns))))
    return counted(table)


def counted(table):
    """The same from deviations, shape (campaigns, 2, parameters)."""
    off, errors = table[:, 0], table[:, 1]
    hits = np.count_nonzero(np.abs(off) <= 1.959964 * errors, axis=0)
    scatter = np.sqrt(np.mean(off**2, axis=0))
    bias = np.mean(off, axis=0)
    return hits, np.mean(errors, axis=0) / scatter, bias


def quickly_covered(campaigns, *, setting=10, duration=6.0):
    """The same for one step from the truth, on a short road whose force the core has made."""
    drive, truth = road(high=6.0, duration=duration), reference_parameters(setting)
    time = np.arange(round(1000.0 * duration)) / 1000.0
    x = np.array([drive.displacement(t) for t in time.tolist()])
    v = np.array([drive.velocity(t) for t in time.tolist()])
    tight = SolverOptions(tolerance=1e-4)
    force = simulate(truth, PURDY_DAMPER, Motion(1e-3, x, v), options=tight).force
    status = dict.fromkeys(NAMES, "fitted")
    table = []
    for seed in range(campaigns):
        random = np.random.default_rng(seed)
        log = Recording(
            name="road.csv",
            path="road.csv",
            sha256="",
            setting=setting,
            time=time,
            displacement=x + 3e-6 * random.standard_normal(len(x)),
            force=force + 4.0 * random.standard_normal(len(x)),
        )
        trace = condition(log, ConditionOptions(centre=0.0))
        problem = Block(PURDY_DAMPER, (trace,), NAMES, SolverOptions(tolerance=1e-2))
        residuals, slopes = linearise(problem, truth)
        step = np.linalg.lstsq(slopes, -residuals, rcond=None)[0]
        found = {n: getattr(truth, n) * np.exp(d) for n, d in zip(NAMES, step, strict=True)}
        fit = replace(
            fakes.fit(setting, status=status),
            parameters=replace(truth, **found),
            logs=(LogFit(trace, 0.001, 0.001),),
        )
        (known,) = uncertainties([linearise_at_fit(fit, PURDY_DAMPER)], Sharing())
        table.append([step, [known.intervals[n].error / found[n] for n in NAMES]])
    return counted(np.array(table))


def stepped(motion, seed, *, setting=10):
    """ln(found/true) of each parameter after two Gauss-Newton steps from the truth."""
    trace = condition(logged(motion, setting, seed=seed), ConditionOptions(centre=0.0))
    truth = found = reference_parameters(setting)
    solver = SolverOptions(tolerance=1e-2)
    problem = Block(PURDY_DAMPER, (trace,), NAMES, solver)
    for _ in range(2):
        residuals, slopes = linearise(problem, found)
        step = np.linalg.lstsq(slopes, -residuals, rcond=None)[0]
        moved = {n: getattr(found, n) * np.exp(d) for n, d in zip(NAMES, step, strict=True)}
        found = replace(found, **moved)
    return np.array([np.log(getattr(found, n) / getattr(truth, n)) for n in NAMES])


def judged_errors(motion, campaigns, *, fitted=100):
    """Mean error of fits over the scatter of all campaigns, and the share of intervals that hold.

    Each error stands beside every deviation, so that the luck of the fits' own noise is left out.
    """
    off = np.array([stepped(motion, seed) for seed in range(campaigns)])
    errors = np.array([deviations(motion, seed)[1] for seed in range(fitted)])
    scatter = np.sqrt(np.mean(off**2, axis=0))
    held = [
        np.mean(np.abs(o)[:, None] <= 1.959964 * e) for o, e in zip(off.T, errors.T, strict=True)
    ]
    return np.mean(errors, axis=0) / scatter, 100.0 * np.array(held)


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", default="steps,sweep,road", help=f"of {', '.join(MOTIONS)}")
    parser.add_argument("--campaigns", type=int, default=50)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--steps", type=int, help="campaigns of two steps each, in place of fits")
    given = parser.parse_args()
    if given.steps:
        print(f"error given over the scatter of {given.steps} (+- {71.0 / given.steps**0.5:.1f} %)")
        for motion in given.motions.split(","):
            ratios, held = judged_errors(motion, given.steps)
            cells = (f"{n} {r:.2f} {h:.1f}" for n, r, h in zip(NAMES, ratios, held, strict=True))
            print(f"{motion:20s}" + "   ".join(cells), flush=True)
        return
    print(f"held by the interval, of {given.campaigns}; error given over scatter; mean error in %")
    for motion in given.motions.split(","):
        hits, ratio, bias = covered(motion, given.campaigns, jobs=given.jobs)
        cells = (
            f"{name} {hit} {r:.2f} {100.0 * b:+.3f}"
            for name, hit, r, b in zip(NAMES, hits, ratio, bias, strict=True)
        )
        print(f"{motion:15s}" + "   ".join(cells), flush=True)


if __name__ == "__main__":
    main()
