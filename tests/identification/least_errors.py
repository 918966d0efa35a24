"""Does a fit of any motion come as near as a log lets anything come?

    python -m tests.identification.least_errors --seeds 40

Raw logs at 1 kHz with 4 N and 3 um, as in `accuracy_of_motions`. By Cramer and Rao no unbiased way
to five parameters errs by less than the roots of the diagonal of 16 N^2 (J^T J)^-1, J the force's
derivatives by their logarithms at the truth: the first line, of the whole log, its motion known
without noise. The second is the same for least squares behind the filter, over the samples that are
compared. Then the errors (rms, two steps from the truth) of logs, and how many of them meet
the bars of any motion. Per cent: R_m1, R_m2, R_m3, K_e, f_f.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

import numpy as np

from damperfit.conditioning import ConditionOptions, apply_filter, condition
from damperfit.identification.fit_problem import Block, linearise
from damperfit.identification.log_facts import weights
from damperfit.recording import Recording
from damperfit.simulation import SolverOptions
from tests.identification.accuracy_of_motions import BARS, DAMPERS, RATE, made, truth_of
from tests.oracles.motions import MOTIONS

NAMES = tuple(BARS)
FORCE_NOISE, PLACE_NOISE = 4.0, 3e-6


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
    time = np.arange(round(drive.duration * RATE)) / RATE
    x, (force, *slopes) = made(drive, truth, damper, len(time), sensitivities=NAMES)
    slopes = np.array([row * getattr(truth, n) for n, row in zip(NAMES, slopes, strict=True)])
    least = 100.0 * FORCE_NOISE * np.sqrt(np.diag(np.linalg.inv(slopes @ slopes.T)))
    behind, found = None, []
    for seed in seeds:
        random = np.random.default_rng(seed)
        log = Recording(
            name="log.csv",
            path="log.csv",
            sha256="",
            setting=setting,
            time=time,
            displacement=x + PLACE_NOISE * random.standard_normal(len(x)),
            force=force + FORCE_NOISE * random.standard_normal(len(x)),
        )
        trace = condition(log, ConditionOptions(centre=0.0))
        if behind is None:
            behind = _behind_filter(trace, slopes)
        found.append(_off(trace, damper, truth))
    return Errors(least, behind, np.array(found))


def _behind_filter(trace, slopes):
    first = round(trace.start_time * RATE)
    kept = slopes[:, first : first + len(trace.force)]
    weight = weights((trace,))[0]
    weight = np.ones(trace.n_samples) if weight is None else weight
    spread = np.zeros(kept.shape[1])
    spread[trace.compared] = weight
    rows = apply_filter(trace.model_filter, kept) * spread
    # A zero-phase filter is its own transpose.
    answer = apply_filter(trace.model_filter._replace(bridged=()), rows * spread)
    answer = np.linalg.inv(rows @ rows.T) @ answer
    return 100.0 * FORCE_NOISE * np.sqrt(np.sum(answer**2, axis=1))


def _off(trace, damper, truth):
    misfit = Block(damper, (trace,), NAMES, SolverOptions(tolerance=1e-2))
    at = truth
    for _ in range(2):
        residuals, slopes = linearise(misfit, at)
        step = np.linalg.lstsq(slopes, -residuals, rcond=None)[0]
        at = replace(
            at, **{n: getattr(at, n) * np.exp(d) for n, d in zip(NAMES, step, strict=True)}
        )
    return [100.0 * np.log(getattr(at, n) / getattr(truth, n)) for n in NAMES]


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first", type=int, default=8000, help="seed")
    parser.add_argument("--setting", type=int, default=10)
    parser.add_argument("--motions", default="sweep,steps,road,two triangles")
    parser.add_argument("--dampers", default=",".join(DAMPERS))
    given = parser.parse_args()
    for motion in given.motions.split(","):
        for name in given.dampers.split(","):
            seeds = range(given.first, given.first + given.seeds)
            seen = errors_of(motion, name, setting=given.setting, seeds=seeds)
            met = np.all(np.abs(seen.of_logs) <= list(BARS.values()), axis=1)
            print(f"{motion}, {name}: {np.count_nonzero(met)} of {given.seeds} meet all bars")
            rows = {
                "least": seen.least,
                "behind the filter": seen.behind_filter,
                "of logs, rms": np.sqrt(np.mean(seen.of_logs**2, axis=0)),
                "of logs, mean": np.mean(seen.of_logs, axis=0),
            }
            for words, row in rows.items():
                cells = "".join(f"{one:+9.3f}" if "mean" in words else f"{one:9.3f}" for one in row)
                print(f"  {words:20s}{cells}", flush=True)


if __name__ == "__main__":
    main()
