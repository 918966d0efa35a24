"""How often two campaigns of one damper are called different, and how often a change is found.

    python -m tests.comparison.false_alarms --pairs 300 --changed 100

Every campaign is a whole fit by the paper's procedure over a soft, a middle and a stiff setting,
with 4 N of noise behind the 30 Hz filter. Pairs differ in the noise alone, or in R_m1 by 1 %
as well. Lines of one pair hang together: the error of a share is that of the mean over pairs.
"""

import argparse
import sys
from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from damperfit.comparison.comparing import ComparisonOptions, compare_runs
from damperfit.comparison.differences import DIFFERENT
from damperfit.conditioning import ConditionOptions, condition
from damperfit.configuration.loading import load_configuration
from damperfit.damper.purdy.parameters import reference_parameters
from damperfit.recording import Trace
from damperfit.results import Run
from damperfit.run.identify import identified
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
    """Return the run of these logs."""
    (found,) = identified(load_configuration(), [], traces=traces, jobs=1)
    found.run.name = name
    return found.run


def compared_pairs(first: Rig, second: Rig, n: int, *, measured: bool = False) -> list:
    """Return comparisons of n pairs of campaigns, each with noise of its own."""
    options = ComparisonOptions(is_measured=measured)
    return [
        compare_runs(first.campaign(2 * k), second.campaign(2 * k + 1), options) for k in range(n)
    ]


def shares(comparisons: list) -> dict[str, tuple[float, float, float]]:
    """Return, by kind of line, the share called different, its error, and of pairs surely so."""
    lines, pairs = defaultdict(list), defaultdict(list)
    for one in comparisons:
        for kind in ("force", "parameter", "figure"):
            told = [line for line in one.of(kind) if np.isfinite(line.chance)]
            lines[kind].append(np.mean([line.verdict == DIFFERENT for line in told]))
            pairs[kind].append(any(line.is_sure for line in told))
    # Lines of one pair hang together, pairs do not.
    n = len(comparisons)
    return {
        kind: (float(np.mean(own)), float(np.std(own) / np.sqrt(n)), float(np.mean(pairs[kind])))
        for kind, own in lines.items()
    }


def found(comparisons: list, name: str = "r_m1") -> float:
    """Return the share of settings and pairs in which a parameter is called different."""
    lines = [line for one in comparisons for line in one.of("parameter")]
    own = [line.verdict == DIFFERENT for line in lines if line.subject.name == name]
    return float(np.mean(own))


def main() -> int:
    """Print the shares; return 1 where a bar is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=300)
    parser.add_argument("--changed", type=int, default=100)
    parser.add_argument("--displacement-noise", type=float, default=0.0)
    given = parser.parse_args()
    first = rig(displacement_noise=given.displacement_noise)
    alike = compared_pairs(first, first, given.pairs)
    print(f"{given.pairs} pairs of campaigns of one damper, settings {SETTINGS}, 4 N of noise")
    told = shares(alike)
    for kind, (share, error, sure) in told.items():
        print(
            f"  {kind:9} {100.0 * share:5.2f} +- {100.0 * error:.2f} % of lines different, "
            f"{100.0 * sure:5.2f} % of pairs surely"
        )
    changed = rig(factor=1.0 + CHANGE, displacement_noise=given.displacement_noise)
    share = found(compared_pairs(first, changed, given.changed))
    print(f"{given.changed} pairs with R_m1 1 % up: found in {100.0 * share:.1f} % of settings")
    is_met = share >= 0.95 and all(
        one <= 0.05 for part, _, sure in told.values() for one in (part, sure)
    )
    return int(not is_met)


if __name__ == "__main__":
    sys.exit(main())
