"""A campaign judged: intervals and diagnoses of every setting, and the sentences they make."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.simulation import SolverOptions
from damperfit.uncertainty.intervals import Uncertainty, collect_evidence, uncertainties
from damperfit.uncertainty.residuals import Diagnosis, diagnose

if TYPE_CHECKING:
    from collections.abc import Iterable

    from damperfit.damper.parameters import Damper
    from damperfit.identification import Campaign
    from damperfit.uncertainty.evidence import Evidence

__all__ = ["METHOD", "Assessment", "assess"]

# A jackknife over 15 cycles scatters by a fifth; below this it misses something.
_BLIND = 0.4

METHOD = (
    "Errors and 95 % intervals: sandwich covariance on the logarithm of the parameter with the "
    "residuals' own autocorrelation; the errors of shared parameters are included."
)


@dataclass(frozen=True, slots=True, eq=False)
class Assessment:
    """How far the numbers of a campaign may be trusted; by rising setting.

    Attributes
    ----------
    uncertainties : tuple of Uncertainty
        Errors, intervals, correlations.
    diagnoses : tuple of Diagnosis
        What the residuals say.
    """

    uncertainties: tuple[Uncertainty, ...] = ()
    diagnoses: tuple[Diagnosis, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """One sentence for each kind of misfit that repeats, with the settings it is seen at."""
        groups: dict[str, list[Diagnosis]] = defaultdict(list)
        for one in self.diagnoses:
            if one.is_structured:
                groups[one.hints[0].name if one.hints else ""].append(one)
        return tuple(_warning(group) for group in groups.values())

    @property
    def cycle_check(self) -> str:
        """How the errors compare with a jackknife over whole cycles; empty with nothing to say."""
        ratios = [
            interval.cycle_ratio
            for known in self.uncertainties
            for interval in known.intervals.values()
            if math.isfinite(interval.cycle_ratio)
        ]
        if not ratios:
            return ""
        low, middle, high = np.quantile(ratios, (0.05, 0.5, 0.95))
        said = (
            "Check of these errors: a jackknife over whole cycles gives "
            f"{middle:.2g} times as much (median; 9 of 10 from {low:.2g} to {high:.2g})"
        )
        return said + (
            "; it sees no misfit that repeats with every cycle, and the larger errors are given."
            if low < _BLIND
            else "."
        )

    @property
    def sentences(self) -> tuple[str, ...]:
        """Noise and lack of fit: one for each structured setting, one for all the others."""
        said = [f"setting {d.setting}: {d.sentence}" for d in self.diagnoses if d.is_structured]
        single = [d for d in self.diagnoses if math.isnan(d.noise_percent)]
        quiet = [d for d in self.diagnoses if not d.is_structured and d not in single]
        if quiet:
            least = min(100.0 * d.noise_percent / max(d.mse_percent, 1e-300) for d in quiet)
            listed = _listed(d.setting for d in quiet)
            said.append(
                f"setting{'s' if len(quiet) > 1 else ''} {listed}: nothing repeats from cycle to "
                f"cycle that the model lacks; noise makes {least:.0f} % of the MSE or more"
            )
        said.extend(f"setting {d.setting}: {d.sentence}" for d in single)
        return tuple(said)


def assess(
    campaign: Campaign,
    damper: Damper,
    *,
    solver: SolverOptions = SolverOptions(tolerance=1e-2),
    jobs: int = 1,
) -> Assessment:
    """Judge every setting of a campaign; costs one simulation for each log.

    Parameters
    ----------
    campaign : Campaign
        Result of `damperfit.identification.identify`.
    damper : Damper
        Geometry, oil and gas.
    solver : SolverOptions
        How exactly to integrate.
    jobs : int
        Threads.
    """
    evidence: list[Evidence] = []
    diagnoses: list[Diagnosis] = []
    n_at_once = max(1, jobs)
    for start in range(0, len(campaign.fits), n_at_once):
        few = replace(campaign, fits=campaign.fits[start : start + n_at_once])
        seen = collect_evidence(few, damper, solver=solver, jobs=jobs)
        diagnoses.extend(diagnose(one) for one in seen)
        evidence.extend(_without_curves(one) for one in seen)
    return Assessment(
        uncertainties=uncertainties(evidence, campaign.sharing),
        diagnoses=tuple(diagnoses),
    )


def _without_curves(evidence: Evidence) -> Evidence:
    """Keep only the residuals of each log: of thousands of logs the rest would fill the memory."""
    none = np.empty((0, 0))
    logs = (replace(log, jacobian=none, gas=none, force=none) for log in evidence.logs)
    return replace(evidence, logs=tuple(logs))


def _warning(group: list[Diagnosis]) -> str:
    """The sentence of the setting with the largest misfit, for all settings of its kind."""
    worst = max(group, key=lambda one: one.mse_percent)
    if len(group) == 1:
        return f"setting {worst.setting}: {worst.sentence}."
    listed = _listed(one.setting for one in group)
    return f"settings {listed}, most at {worst.setting}: {worst.sentence}."


def _listed(settings: Iterable[int]) -> str:
    """Whole numbers with runs of three and more drawn together: 1, 2, 5-9."""
    runs: list[list[int]] = []
    for setting in sorted(settings):
        if runs and setting == runs[-1][-1] + 1:
            runs[-1].append(setting)
        else:
            runs.append([setting])
    return ", ".join(
        f"{run[0]}-{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs
    )
