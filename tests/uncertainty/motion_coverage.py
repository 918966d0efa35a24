"""Do 95 % intervals cover 95 of 100 on logs that are no steady sine?

    python -m tests.uncertainty.motion_coverage --motions steps,sweep,road --campaigns 100

Setting 10, 1 kHz, 4 N and 3 um of noise, all five parameters free. Each line: how many intervals of
so many hold the truth, and the errors given over the scatter found.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.parameters import PURDY_DAMPER
from damperfit.damper.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.uncertainty import assess
from tests.oracles.motions import MOTIONS, logged

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
    off, errors = table[:, 0], table[:, 1]
    hits = np.count_nonzero(np.abs(off) <= 1.959964 * errors, axis=0)
    scatter = np.sqrt(np.mean(off**2, axis=0))
    bias = np.mean(off, axis=0)
    return hits, np.mean(errors, axis=0) / scatter, bias


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", default="steps,sweep,road", help=f"of {', '.join(MOTIONS)}")
    parser.add_argument("--campaigns", type=int, default=50)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
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
