"""How often two campaigns of one damper are called different, and how often a change is found.

    python -m tests.comparison.false_alarms --pairs 300 --changed 100

Every campaign is a whole fit by the paper's procedure over a soft, a middle and a stiff setting,
with 4 N of noise behind the 30 Hz filter. Pairs differ in the noise alone, or in R_m1 by 1 %
as well. Lines of one pair hang together, so that a share of 5 % over 100 of their own is known
to 1.8 % only. Each campaign is therefore compared with several others, which costs no fit more,
and the error of each share is told, by leaving out one campaign after the other.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np

from damperfit.adjustment.force_at import fastest_sine, stage_of
from damperfit.comparison import ComparisonOptions, Sameness, compare_runs, measured_tests
from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import identify
from damperfit.recording import Trace
from damperfit.results import Run
from damperfit.simulation import SolverOptions
from damperfit.tables.reading import LogSignals
from damperfit.tables.rows import make_tables
from damperfit.uncertainty import assess
from tests.fakes import fitted_run as fitted_run_of
from tests.identification.rig import recording
from tests.uncertainty.coverage import MadeUpCampaign, noisy

SETTINGS = (1, 10, 20)
CHANGE = 0.01


@dataclass(frozen=True)
class Rig:
    """One damper on the rig: its quiet logs, and the same conditioned."""

    made_up: MadeUpCampaign
    logs: list
    clean: list[Trace]

    def campaign(self, seed: int) -> Run:
        """Return a campaign with noise of its own."""
        rng = np.random.default_rng(seed)
        return fitted_run(noisy(self.made_up, self.logs, self.clean, rng), name=str(seed))


def rig(*, factor: float = 1.0, duration: float = 10.0, displacement_noise: float = 0.0) -> Rig:
    """Return the reference damper with R_m1 at all settings times a factor."""
    made_up = MadeUpCampaign(displacement_noise=displacement_noise, duration=duration)
    logs = []
    for setting in SETTINGS:
        truth = reference_parameters(setting)
        changed = truth.replace(r_m1=factor * truth.r_m1)
        logs.append(recording(setting, changed, rate=made_up.rate, duration=duration))
    return Rig(made_up, logs, [condition(log, ConditionOptions()) for log in logs])


def fitted_run(traces: list[Trace], *, name: str) -> Run:
    """Return what `compare` would read from the results folder of these logs."""
    campaign = identify(traces, PURDY_DAMPER)
    assessment = assess(campaign, PURDY_DAMPER)
    tables = make_tables(campaign, assessment=assessment)
    rows = tables["parameters"].to_pylist()
    fitted = fitted_run_of(
        PURDY_DAMPER,
        tuple(stage_of(fit, assessment) for fit in campaign.fits),
        fastest_sine(
            [(s.amplitude, s.frequency, s.peak_speed) for trace in traces for s in trace.stretches]
        ),
        assessment.forces,
        {fit.setting: row for fit, row in zip(campaign.fits, rows, strict=True)},
        campaign.quantities,
        SolverOptions(),
    )
    fitted.tests = tuple(test for trace in traces for test in _tests(trace))
    fitted.name = name
    return fitted


def _tests(trace: Trace) -> tuple:
    n = len(trace.force)
    nothing = np.full(n, np.nan)
    signals = LogSignals(
        trace.setting,
        trace.name,
        trace.start_time + trace.interval * np.arange(n),
        trace.displacement,
        trace.velocity,
        trace.force,
        nothing,
        np.stack([nothing] * 3),
    )
    return measured_tests(signals, [one.describe(trace) for one in trace.stretches])


def compared_pairs(first: Rig, second: Rig, n: int, *, measured: bool = False) -> list:
    """Return comparisons of n pairs of campaigns, each with noise of its own."""
    options = ComparisonOptions(is_measured=measured)
    return [
        compare_runs(first.campaign(2 * k), second.campaign(2 * k + 1), options) for k in range(n)
    ]


def compared_among(rig: Rig, n: int, others: int = 20) -> dict[tuple[int, int], Any]:
    """Return n campaigns of one damper, each compared with some that follow, by their places."""
    runs = [rig.campaign(k) for k in range(n)]
    options = ComparisonOptions(is_measured=False)
    places = [(i, (i + d) % n) for i in range(n) for d in range(1, min(others, (n - 1) // 2) + 1)]
    return {(i, k): compare_runs(runs[i], runs[k], options) for i, k in places}


def errors_of_shares(among: dict[tuple[int, int], Any], n: int) -> dict[str, float]:
    """Return the standard error of each kind's share of lines called different: a jackknife."""
    counts: dict[str, np.ndarray] = {}
    for pair, one in among.items():
        for kind in ("force", "parameter", "figure"):
            told = [line for line in one.of(kind) if np.isfinite(line.chance)]
            of_kind = counts.setdefault(kind, np.zeros((n + 1, 2)))
            both = sum(line.verdict is Sameness.DIFFERENT for line in told), len(told)
            of_kind[n] += both
            for place in pair:
                of_kind[place] += both
    found = {}
    for kind, table in counts.items():
        without = table[n] - table[:n]
        rates = without[:, 0] / without[:, 1]
        found[kind] = float(np.sqrt((n - 1) * np.var(rates)))
    return found


def shares(comparisons: list) -> dict[str, tuple[float, float]]:
    """Return, by kind of line, the share called different, and of pairs with a sure difference."""
    lines, pairs = defaultdict(list), defaultdict(list)
    for one in comparisons:
        for kind in ("force", "parameter", "figure"):
            told = [line for line in one.of(kind) if np.isfinite(line.chance)]
            lines[kind] += [line.verdict is Sameness.DIFFERENT for line in told]
            pairs[kind].append(any(line.is_sure for line in told))
    return {kind: (float(np.mean(lines[kind])), float(np.mean(pairs[kind]))) for kind in lines}


def found(comparisons: list, name: str = "r_m1") -> float:
    """Return the share of settings and pairs in which a parameter is called different."""
    return float(
        np.mean(
            [
                line.verdict is Sameness.DIFFERENT
                for one in comparisons
                for line in one.of("parameter")
                if line.subject.name == name
            ]
        )
    )


def main() -> int:
    """Print the shares; return 1 where a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=300)
    parser.add_argument("--changed", type=int, default=100)
    parser.add_argument("--displacement-noise", type=float, default=0.0)
    given = parser.parse_args()
    if given.pairs < 2:
        parser.error("--pairs: at least 2, each campaign is left out in turn")
    first = rig(displacement_noise=given.displacement_noise)
    n = 2 * given.pairs
    among = compared_among(first, n)
    print(f"{n} campaigns of one damper, settings {SETTINGS}, 4 N of noise, {len(among)} pairs")
    told, errors = shares(list(among.values())), errors_of_shares(among, n)
    for kind, (share, sure) in told.items():
        print(
            f"  {kind:9} {100.0 * share:5.2f} +- {100.0 * errors[kind]:.2f} % of lines different, "
            f"{100.0 * sure:5.2f} % of pairs surely"
        )
    changed = rig(factor=1.0 + CHANGE, displacement_noise=given.displacement_noise)
    other = compared_pairs(first, changed, given.changed)
    share = found(other)
    print(f"{given.changed} pairs with R_m1 1 % up: found in {100.0 * share:.1f} % of settings")
    is_met = share >= 0.95 and all(rate <= 0.05 for pair in told.values() for rate in pair)
    return int(not is_met)


if __name__ == "__main__":
    sys.exit(main())
