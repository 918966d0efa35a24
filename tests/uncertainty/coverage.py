"""Monte Carlo of the intervals: fits of noisy copies of known logs, and how often they cover.

    python -m tests.uncertainty.coverage --fits 1000 [--white] [--displacement-noise 8e-6]

Every one is a whole campaign by the paper's procedure, or another, over a soft, a middle and a
stiff setting, so that the errors of the shared R_m3 and f_f are in it.
"""

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from damperfit.conditioning import ConditionOptions, apply_filter, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.uncertainty import linearise_settings, uncertainties
from tests.identification.rig import recording

SETTINGS = (1, 10, 20)
NAMES = ("r_m1", "r_m2", "k_e", "r_m3", "f_f")
PER_JOB = 25


@dataclass(frozen=True)
class MadeUpCampaign:
    """What is simulated: noise in N and m, filter, sample rate, length."""

    noise: float = 4.0
    displacement_noise: float = 0.0
    is_white: bool = False
    rate: float = 500.0
    duration: float = 10.0
    procedure: str = "paper"

    @property
    def options(self):
        return ConditionOptions(filter="none" if self.is_white else "zero_phase")


def clean_logs(made_up):
    return [recording(s, rate=made_up.rate, duration=made_up.duration) for s in SETTINGS]


def noisy(made_up, logs, clean, rng):
    """Return traces of the logs with noise of their own."""
    traces = []
    for quiet, trace in zip(logs, clean, strict=True):
        shaken = made_up.noise * rng.standard_normal(len(quiet.time))
        if made_up.displacement_noise:
            moved = made_up.displacement_noise * rng.standard_normal(len(quiet.time))
            x, force = quiet.displacement + moved, quiet.force + shaken
            traces.append(condition(replace(quiet, force=force, displacement=x), made_up.options))
        else:  # filtering is linear: the same numbers at a tenth of the cost
            seen = apply_filter(trace.model_filter, shaken[: len(trace.force)])
            traces.append(replace(trace, force=trace.force + seen))
    return traces


def one(job):
    """Return ln of value, truth, low and high, (fits, settings, names, 4)."""
    made_up, seed = job
    logs = clean_logs(made_up)
    clean = [condition(log, made_up.options) for log in logs]
    rows = []
    for k in range(PER_JOB):
        traces = noisy(made_up, logs, clean, np.random.default_rng([seed, k]))
        campaign = identify(traces, PURDY_DAMPER, FitOptions(made_up.procedure))
        known = uncertainties(linearise_settings(campaign, PURDY_DAMPER), campaign.sharing)
        table = np.full((len(SETTINGS), len(NAMES), 4), np.nan)
        for i, (fit, found) in enumerate(zip(campaign.fits, known, strict=True)):
            truth = reference_parameters(fit.setting)
            for j, name in enumerate(NAMES):
                interval = found.intervals[name]
                values = getattr(fit.parameters, name), getattr(truth, name)
                table[i, j] = np.log([*values, interval.low, interval.high])
        rows.append(table)
    return np.array(rows)


def run(made_up, fits, workers=1):
    """Return (fits, settings, names, 4)."""
    jobs = [(made_up, seed) for seed in range(-(-fits // PER_JOB))]
    if workers == 1:
        return np.concatenate([one(job) for job in jobs])[:fits]
    with ProcessPoolExecutor(workers) as pool:
        return np.concatenate(list(pool.map(one, jobs)))[:fits]


def summary(table):
    """Return coverage, mean width over 2 x 1.96 true scatter, and bias over scatter."""
    value, truth, low, high = (table[..., i] for i in range(4))
    covered = np.mean((low <= truth) & (truth <= high), axis=0)
    scatter = np.std(value, axis=0, ddof=1)
    width = np.mean(high - low, axis=0) / (2 * 1.959964 * scatter)
    return covered, width, np.mean(value - truth, axis=0) / scatter


def main() -> int:
    """Print coverage and width; return 1 when the coverage of an own parameter is not 93-97 %."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fits", type=int, default=1000)
    parser.add_argument("--white", action="store_true", dest="is_white")
    parser.add_argument("--displacement-noise", type=float, default=0.0)
    parser.add_argument("--rate", type=float, default=500.0)
    parser.add_argument("--duration", type=float, default=10.0)
    parser.add_argument("--procedure", default="paper")
    parser.add_argument("--workers", type=int, default=1)
    given = vars(parser.parse_args())
    fits, workers = given.pop("fits"), given.pop("workers")
    made_up = MadeUpCampaign(**given)
    table = run(made_up, fits, workers)
    covered, width, bias = summary(table)
    print(f"{made_up}, {len(table)} campaigns")
    print("setting parameter coverage width/scatter bias/scatter")
    for i, setting in enumerate(SETTINGS):
        for j, name in enumerate(NAMES):
            print(
                f"{setting:7d} {name:>9s} {100 * covered[i, j]:7.1f}% {width[i, j]:13.3f} "
                f"{bias[i, j]:12.2f}"
            )
    own = covered[:, :3]
    return int(not (np.all(own >= 0.93) and np.all(own <= 0.97)))


if __name__ == "__main__":
    sys.exit(main())
