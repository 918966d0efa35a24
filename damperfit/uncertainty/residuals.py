"""What the residuals say that the MSE does not: noise or missing physics, and which.

The residual is laid over itself cycle by cycle. What differs between cycles is noise (of both
channels); what repeats is lack of fit. With C cycles of scatter s^2 the mean residual of pure noise
has the power s^2/C, which is taken off::

    repeating = mean over phases of (mean residual)^2 - s^2/C

What the model lacks is then sought in `damperfit.uncertainty.flaws`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.gas_force import YIELDS, held_shares
from damperfit.identification.fit_setting import EXCELLENT
from damperfit.identification.sharing import listed_settings
from damperfit.problem import Problem, warning
from damperfit.statistics import fisher_chance, mean_of, median, variance_of
from damperfit.uncertainty.correlation import autocorrelation, independent
from damperfit.uncertainty.flaws import Hint, seek_flaws

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Stretch
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.linearisation import Linearisation

    FloatArray = NDArray[np.float64]

__all__ = ["Diagnosis", "diagnose", "group_warning", "reconciled", "residual_scatter"]

# The repeating power of pure noise over its scatter is F-distributed; beyond the bar once in as
# many settings.
_CHANCE = 1e-6
# Misfit over noise where nothing repeats: noise of the displacement may double it.
_MUCH = 4.0
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


def diagnose(
    linearised: Linearisation, *, doubted: tuple[str, ...] = ()
) -> tuple[Diagnosis, dict[str, FloatArray]]:
    """Return what the residuals of a setting say; from its linearised fit alone, no simulation.

    And the pulls of the hints, (k,) each, as `seek_flaws` has them.

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
    hints, pulls = (
        seek_flaws(linearised, repeats, doubted=doubted, has_yielded=share >= YIELDS)
        if is_structured
        else ((), {})
    )
    hints = tuple(one for one in hints if one.name != "delay" or _fits_skew(linearised, one.amount))
    noise_percent = float(min(100.0 * noise / variance, fit.mse_percent))
    found = Diagnosis(
        setting=fit.setting,
        mse_percent=fit.mse_percent,
        noise_percent=noise_percent,
        is_structured=is_structured,
        correlation=_cycle_correlation(parts),
        runs_ratio=_runs_ratio(parts),
        hints=hints,
        sentence="",
        held_share=share,
        modelled_share=modelled,
    )
    found = replace(found, sentence=_sentence(found) + _warned(linearised, found))
    return found, {one.name: pulls[one.name] for one in hints if one.name in pulls}


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
    # Half of the logs have no gain beside the others.
    n_gains = sum(h.name == "force_gain" for one in kept_hints for h in one.hints)
    if 2 * n_gains >= len(kept_hints):
        kept_hints = tuple(_without(one, "force_gain", kept=None) for one in kept_hints)
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


def group_warning(group: Sequence[Diagnosis]) -> Problem:
    """Return what is said of the setting with the largest misfit, for all settings of its kind."""
    worst = max(group, key=lambda one: one.mse_percent)
    text, where = "setting {setting}: {words}.", ""
    if len(group) > 1:
        text = "settings {settings}, most at {setting}: {words}."
        where = listed_settings(one.setting for one in group)
    return warning(
        "misfit",
        text,
        settings=where or str(worst.setting),
        setting=worst.setting,
        words=worst.sentence,
        mse_percent=worst.mse_percent,
        noise_percent=worst.noise_percent,
        flaw=worst.hints[0].name if worst.hints else "",
    )


@dataclass(frozen=True, slots=True, eq=False)
class StretchResiduals:
    """The residuals of one stretch, 0 where none counts; of two cycles or more laid over."""

    stretch: Stretch
    interval: float  # of the samples, s
    residuals: FloatArray  # (n,), N
    folded: FloatArray | None = None  # the cycles, (cycles, phases)
    about: FloatArray | None = None  # what each differs from their mean by


def residuals_by_stretch(linearised: Linearisation) -> Iterator[StretchResiduals]:
    """Yield the residuals of each stretch."""
    for log, seen in zip(linearised.fit.logs, linearised.logs, strict=True):
        for stretch, place in zip(log.trace.stretches, log.trace.places, strict=True):
            residuals = np.where(seen.weights[place] > 0.0, seen.residuals[place], 0.0)
            folded = about = None
            if stretch.n_cycles > 1:
                folded = _fold(residuals, stretch)
                about = folded - folded.mean(axis=0)
            yield StretchResiduals(stretch, log.trace.interval, residuals, folded, about)


def split_power(parts: Sequence[StretchResiduals]) -> tuple[float, float, Callable[[], bool]]:
    """Return repeating and scattered mean squares, N^2, and whether noise cannot be all of it."""
    repeats, noise, expected, n_samples = 0.0, 0.0, 0.0, 0
    for part in parts:
        if part.folded is None or part.about is None:
            continue
        n, (n_cycles, n_phases) = len(part.residuals), part.folded.shape
        scatter = float(np.sum(part.about**2)) / (n_phases * (n_cycles - 1))
        n_samples += n
        repeats += n * (float(np.mean(part.folded.mean(axis=0) ** 2)) - scatter / n_cycles)
        expected += n * scatter / n_cycles
        noise += n * scatter
    if not n_samples:
        return _unrepeated(parts)
    ratio = 1.0 + repeats / max(expected, 1e-300)
    return repeats / n_samples, noise / n_samples, lambda: is_beyond_chance(parts, ratio)


def is_beyond_chance(parts: Sequence[StretchResiduals], ratio: float) -> bool:
    """Whether the power of the mean cycles over what noise has is beyond chance."""
    phases, others = 0.0, 0.0
    for part in parts:
        if part.about is not None:
            worth = independent_phases(part.about)
            phases += worth
            others += worth * (part.stretch.n_cycles - 1)
    return fisher_chance(phases, others, ratio) < _CHANCE


def _unrepeated(parts: Sequence[StretchResiduals]) -> tuple[float, float, Callable[[], bool]]:
    """The same where nothing repeats: misfit and noise by what was found above the filter's band.

    Noise of the displacement is not in that; it makes less than the force's in a usual log.
    """
    if any(part.stretch.n_cycles for part in parts):
        return math.nan, math.nan, lambda: False
    n = sum(len(part.residuals) for part in parts)
    noise = sum(len(part.residuals) * part.stretch.noise**2 for part in parts) / n
    whole = sum(float(part.residuals @ part.residuals) for part in parts) / n
    return whole - noise, noise, lambda: whole / max(noise, 1e-300) > _MUCH


def independent_phases(scatter: FloatArray) -> float:
    """Return how many independent squares the mean square of one cycle's noise is worth.

    From the scatter about the mean cycle, in which nothing repeats, shape (cycles, phases); fewer
    where the noise is larger in part of the cycle (Satterthwaite).
    """
    n_cycles, n_phases = scatter.shape
    rho = autocorrelation(scatter.ravel(), n_phases // 2)
    power = np.einsum("ij,ij->j", scatter, scatter)
    # A variance from few cycles is itself uneven, by 2/(n - 1).
    uneven = n_phases * float(power @ power) / max(float(np.sum(power)) ** 2, 1e-300)
    uneven = max(uneven / (1.0 + 2.0 / (n_cycles - 1)), 1.0)
    return float(max(independent(rho, n_phases) / uneven, 1.0))


def residual_scatter(residuals: FloatArray, stretch: Stretch) -> float:
    """Return the mean square of what differs from cycle to cycle, N^2: noise of both channels.

    Parameters
    ----------
    residuals : numpy.ndarray
        Shape (n,), over the stretch.
    stretch : Stretch
        Steady cycles; NaN for a single one.
    """
    if stretch.n_cycles < 2:
        return math.nan
    return float(np.mean(np.var(_fold(residuals, stretch), axis=0, ddof=1)))


def _fold(residuals: FloatArray, stretch: Stretch) -> FloatArray:
    """Residuals over cycles and phases, shape (cycles, phases)."""
    starts = stretch.cycle_starts - stretch.first
    lengths = np.diff(starts)
    n_phases = max(8, round(mean_of(lengths)))
    nearest = starts[:-1, None] + lengths[:, None] * (np.arange(n_phases) / n_phases)
    # Beyond an end it is the last sample.
    return residuals.take(np.rint(nearest).astype(np.intp), mode="clip")


def _cycle_correlation(parts: Sequence[StretchResiduals]) -> float:
    """Autocorrelation at a lag of one cycle, the largest of the stretches."""
    values = []
    for part in parts:
        residuals, n = part.residuals, len(part.residuals)
        period = round(1.0 / (part.stretch.frequency * part.interval))
        if 2 * period < n:
            power = max(float(residuals @ residuals), 1e-300)
            lagged = float(residuals[:-period] @ residuals[period:])
            values.append(lagged / power * n / (n - period))
    return max(values, default=math.nan)


def _runs_ratio(parts: Sequence[StretchResiduals]) -> float:
    """Sign changes of the residual over those of its scatter about the mean cycle."""
    pairs = [(one.folded, one.about) for one in parts if one.folded is not None]
    counts = [[_sign_changes(rows) for rows in pair if rows is not None] for pair in pairs]
    seen, expected = (sum(column) for column in zip(*counts, strict=True)) if counts else (0, 0)
    return seen / expected if expected else math.nan


def _sign_changes(rows: FloatArray) -> int:
    negative = np.signbit(rows)
    return int(np.count_nonzero(negative[:, 1:] != negative[:, :-1]))
