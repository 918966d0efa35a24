"""What the residuals say that the MSE does not: noise or missing physics, and which.

What repeats of them is told in `damperfit.uncertainty.repeating`; what the model lacks is then
sought in `damperfit.uncertainty.flaws`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.gas_force import YIELDS, held_shares
from damperfit.identification.fit_setting import EXCELLENT
from damperfit.identification.sharing import listed_settings
from damperfit.statistics import median, variance_of
from damperfit.uncertainty.flaws import Hint, seek_flaws
from damperfit.uncertainty.repeating import (
    cycle_correlation,
    residuals_by_stretch,
    runs_ratio,
    split_power,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.linearisation import Linearisation

    FloatArray = NDArray[np.float64]

__all__ = ["Diagnosis", "diagnose", "group_warning", "reconciled"]

# Below this share of the force's variance, 0.1 N of 300 N, the integrator's error repeats too.
_NEGLIGIBLE = 1e-7
# Noise of the displacement is looked at first where noise makes this much of the misfit.
_NOISE_COUNTS = 1.0 / 3.0
# Delay and skew of a log that differ by less, ms, or by less than half, are one.
_SKEW_AGREES = 1.0
# What all settings have in common: the rig's timing and the damper's gas. Of opposite amounts those
# stand that are so many times as frequent.
_IN_COMMON = ("delay", "gas_pressure", "gas_exponent", "gas_volume")
_MOST = 3
# Warnings on a log that leave a misfit in every cycle, in the order to look at them: no tare can be
# reported before the signs are right.
_FAULTS_OF_LOGS = (
    "direction",
    "clipping",
    "stuck",
    "skew",
    "steps",
    "displacement_noise",
    "tare",
    "velocity_channel",
    "rig_filter",
)


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """What the residuals of one setting say.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    mse_percent : float
        Eq. (22).
    noise_percent : float
        The part of it that differs from cycle to cycle; NaN for a single cycle.
    is_structured : bool
        Whether more of the residual repeats with the cycle than noise can explain.
    correlation : float
        Autocorrelation of the residual at a lag of one cycle: 0 for noise, towards 1 when the
        residual repeats. NaN for two cycles or less.
    runs_ratio : float
        Runs of one sign over what noise behind the same filter would have; well below 1 when
        the residual is structured.
    hints : tuple of Hint
        What may be missing, best first; empty where nothing repeats or nothing explains it.
    sentence : str
        For people.
    held_share : float
        Share of the force's range left at a tenth of the speed while slowing down; NaN where
        no log tells it. A damper that yields before it slides holds `YIELDS` or more.
    modelled_share : float
        The same of the model's force.
    """

    setting: Setting
    mse_percent: float
    noise_percent: float
    is_structured: bool
    correlation: float
    runs_ratio: float
    hints: tuple[Hint, ...]
    sentence: str
    held_share: float = math.nan
    modelled_share: float = math.nan

    @property
    def repeating_percent(self) -> float:
        """The part of the MSE that repeats with the cycle; NaN for a single cycle."""
        return max(self.mse_percent - self.noise_percent, 0.0)

    @property
    def has_yielded(self) -> bool:
        """Whether the damper yields before it slides."""
        return self.held_share >= YIELDS

    @property
    def is_met(self) -> bool:
        """Whether the model meets the logs as well as the paper calls excellent."""
        return self.mse_percent < EXCELLENT


def diagnose(linearised: Linearisation, *, doubted: tuple[str, ...] = ()) -> Diagnosis:
    """Return what the residuals of a setting say; from its linearised fit alone, no simulation.

    Parameters
    ----------
    linearised : Linearisation
        Of the setting.
    doubted : tuple of str
        Shared parameters of which one value for all settings is known not to hold.
    """
    fit = linearised.fit
    parts = tuple(residuals_by_stretch(linearised))
    repeats, noise, is_more = split_power(parts)
    forces = [log.trace.force[log.trace.compared] for log in fit.logs]
    variance = variance_of(forces[0] if len(forces) == 1 else np.concatenate(forces))
    is_structured = bool(repeats > _NEGLIGIBLE * variance and is_more())
    shares = [
        held_shares(log.trace, np.stack([measured, seen.force]))
        for log, measured, seen in zip(fit.logs, forces, linearised.logs, strict=True)
    ]
    share, modelled = (_middle(of) for of in zip(*shares, strict=True))
    hints = (
        seek_flaws(linearised, repeats, doubted=doubted, has_yielded=share >= YIELDS)
        if is_structured
        else ()
    )
    hints = tuple(one for one in hints if one.name != "delay" or _fits_skew(linearised, one.amount))
    noise_percent = float(min(100.0 * noise / variance, fit.mse_percent))
    found = Diagnosis(
        setting=fit.setting,
        mse_percent=fit.mse_percent,
        noise_percent=noise_percent,
        is_structured=is_structured,
        correlation=cycle_correlation(parts),
        runs_ratio=runs_ratio(parts),
        hints=hints,
        sentence="",
        held_share=share,
        modelled_share=modelled,
    )
    return replace(found, sentence=_sentence(found) + _warned(linearised, found))


def _middle(shares: Sequence[float]) -> float:
    known = [share for share in shares if math.isfinite(share)]
    return median(known) if known else math.nan


def _fits_skew(linearised: Linearisation, delay: float) -> bool:
    """Whether a delay, ms, is none that the logs' own skew contradicts."""
    for log in linearised.fit.logs:
        for one in log.trace.findings:
            if one.name == "skew" and one.value is not None:
                left = 0.0 if one.is_correction else 1e3 * one.value
                if abs(delay - left) > max(_SKEW_AGREES, 0.5 * abs(delay)):
                    return False
    return True


def reconciled(diagnoses: Iterable[Diagnosis]) -> tuple[Diagnosis, ...]:
    """Return the diagnoses of a run without causes that contradict each other.

    The rig's delay and the damper's gas are one for all settings: where a few settings want the
    opposite of what most want, theirs is none, and where opinions are divided, nobody's is.

    Parameters
    ----------
    diagnoses : iterable of Diagnosis
        Of all settings of a run.
    """
    kept_hints = tuple(diagnoses)
    for name in _IN_COMMON:
        signs = [h.amount > 0.0 for one in kept_hints for h in one.hints if h.name == name]
        few, many = sorted((signs.count(True), signs.count(False)))
        if few:
            kept = None if many < _MOST * few else signs.count(True) > signs.count(False)
            kept_hints = tuple(_without(one, name, kept=kept) for one in kept_hints)
    return kept_hints


def _without(diagnosis: Diagnosis, name: str, *, kept: bool | None) -> Diagnosis:
    """Return a diagnosis without a hint, unless that has the sign that is kept."""
    hints = tuple(h for h in diagnosis.hints if h.name != name or (h.amount > 0.0) is kept)
    if hints == diagnosis.hints:
        return diagnosis
    pointer = diagnosis.sentence[len(_sentence(diagnosis)) :]
    left = replace(diagnosis, hints=hints)
    return replace(left, sentence=_sentence(left) + pointer)


def _warned(linearised: Linearisation, diagnosis: Diagnosis) -> str:
    """Point to the warnings on these logs that may be the cause."""
    if not diagnosis.is_structured:
        return ""
    found = [
        f"{one.name} of {log.trace.name}"
        for fault in _FAULTS_OF_LOGS
        for log in linearised.fit.logs
        for one in log.trace.findings
        if one.severity == "warning" and one.name.endswith(fault)
        if _may_explain(fault, diagnosis)
    ]
    more = f" and {len(found) - 1} more" if len(found) > 1 else ""
    return f"; see the warning {found[0]}{more}" if found else ""


def _may_explain(fault: str, diagnosis: Diagnosis) -> bool:
    """Whether a warning on a log may be why its misfit is as it is."""
    if fault == "displacement_noise":
        return diagnosis.noise_percent >= _NOISE_COUNTS * diagnosis.mse_percent
    hints = diagnosis.hints  # strokes taken for each other leave the gas force twice: in position
    is_known = diagnosis.is_met or diagnosis.has_yielded or hints
    return fault != "direction" or not is_known or any(h.family == "position" for h in hints)


def _sentence(diagnosis: Diagnosis) -> str:
    mse, noise, hints = diagnosis.mse_percent, diagnosis.noise_percent, diagnosis.hints
    if math.isnan(noise):
        return f"MSE {mse:.2g} %; a single cycle cannot separate noise from lack of fit"
    said = f"MSE {mse:.2g} %, of which {noise:.2g} % is noise"
    if not diagnosis.is_structured:
        return f"{said}: no misfit repeats"
    yields = _yields(diagnosis) if diagnosis.has_yielded else ""
    if yields and not hints:
        return f"{said}: {yields}"
    if not hints:
        return f"{said}: a misfit repeats, and its cause was not found"
    named = " or ".join(hint.words for hint in hints)
    best = hints[0]
    return (f"{said}: a misfit repeats, {100.0 * best.share:.0f} % of it as from {named}") + (
        f"; {yields}" if yields and not diagnosis.is_met else ""
    )


def _yields(diagnosis: Diagnosis) -> str:
    """What is said of a damper that yields, as the model does where it meets the logs."""
    share = 100.0 * diagnosis.held_share
    holds = f"the damper holds {share:.0f} % of its force down to a tenth of its "
    if diagnosis.is_met and diagnosis.modelled_share >= min(YIELDS, 0.9 * diagnosis.held_share):
        return (
            f"{holds}speed, as a preloaded valve, dry friction or a magneto-rheological fluid "
            "does, and so does the model; a misfit repeats, and its cause was not found"
        )
    return (
        f"{holds}speed: it yields before it slides, like a preloaded valve, dry friction or a "
        "magneto-rheological fluid, and the model misses that"
    )


def group_warning(group: Sequence[Diagnosis]) -> str:
    """Return the sentence of the setting with the largest misfit, for all settings of its kind."""
    worst = max(group, key=lambda one: one.mse_percent)
    if len(group) == 1:
        return f"setting {worst.setting}: {worst.sentence}."
    listed = listed_settings(one.setting for one in group)
    return f"settings {listed}, most at {worst.setting}: {worst.sentence}."
