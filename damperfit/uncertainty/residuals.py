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
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning.gas_force import YIELDS, held_shares
from damperfit.identification.fit_setting import EXCELLENT
from damperfit.identification.sharing import listed_settings
from damperfit.problem import Problem, warning
from damperfit.statistics import fisher_chance, mean_of, median, variance_of
from damperfit.uncertainty.correlation import autocorrelation, independent
from damperfit.uncertainty.flaws import Hint, seek_flaws

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Stretch
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.linearisation import Linearisation

    FloatArray = NDArray[np.float64]

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
    """What the residuals of one setting say."""

    setting: Setting
    mse_percent: float  # eq. (22)
    noise_percent: float  # the part that differs from cycle to cycle; NaN for a single cycle
    is_structured: bool  # whether more of the residual repeats with the cycle than noise explains
    # Autocorrelation of the residual at a lag of one cycle: 0 for noise, towards 1 when it repeats.
    # NaN for two cycles or less.
    correlation: float
    # Runs of one sign over what noise behind the same filter would have; well below 1 when the
    # residual is structured.
    runs_ratio: float
    # What may be missing, best first; empty where nothing repeats or nothing explains it.
    hints: tuple[Hint, ...]
    sentence: str
    # Share of the force's range left at a tenth of the speed while slowing down; NaN where no log
    # tells it. A damper that yields before it slides holds `YIELDS` or more.
    held_share: float = math.nan
    modelled_share: float = math.nan  # the same of the model's force

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

    And the pulls of the hints, (k,) each, as `seek_flaws` has them. Doubted are shared parameters
    of which one value for all settings is known not to hold.
    """
    fit = linearised.fit
    parts = residuals_by_stretch(linearised)
    repeats, noise, is_more = split_power(parts)
    forces = [log.trace.force[log.trace.compared] for log in fit.logs]
    variance = variance_of(forces[0] if len(forces) == 1 else np.concatenate(forces))
    is_structured = bool(repeats > _NEGLIGIBLE * variance and is_more())
    shares = [
        held_shares(log.trace, np.stack([measured, seen.force]))
        for log, measured, seen in zip(fit.logs, forces, linearised.logs, strict=True)
    ]
    known = [[share for share in of if math.isfinite(share)] for of in zip(*shares, strict=True)]
    share, modelled = (median(of) if of else math.nan for of in known)
    hints: tuple[Hint, ...] = ()
    pulls: dict[str, FloatArray] = {}
    if is_structured:
        hints, pulls = seek_flaws(linearised, repeats, doubted=doubted, has_yielded=share >= YIELDS)
    hints = tuple(one for one in hints if one.name != "delay" or _fits_skew(linearised, one.amount))
    folded = [part for part in parts if part.folded.size]
    runs = sum(_sign_changes(part.folded) for part in folded)
    of_noise = sum(_sign_changes(part.about) for part in folded)
    found = Diagnosis(
        setting=fit.setting,
        mse_percent=fit.mse_percent,
        noise_percent=float(min(100.0 * noise / variance, fit.mse_percent)),
        is_structured=is_structured,
        correlation=max(filter(math.isfinite, map(_cycle_correlation, parts)), default=math.nan),
        runs_ratio=runs / of_noise if of_noise else math.nan,
        hints=hints,
        sentence="",
        held_share=share,
        modelled_share=modelled,
    )
    found = replace(found, sentence=_sentence(found) + _warned(linearised, found))
    return found, {one.name: pulls[one.name] for one in hints if one.name in pulls}


def _fits_skew(linearised: Linearisation, delay: float) -> bool:
    """Whether a delay, ms, is none that the logs' own skew contradicts."""
    for log in linearised.fit.logs:
        for one in log.trace.findings:
            if one.name == "skew" and one.value is not None:
                left = 0.0 if one.is_correction else 1e3 * one.value
                if abs(delay - left) > max(_SKEW_AGREES, 0.5 * abs(delay)):
                    return False
    return True


# The residuals of each stretch, and their power


class StretchResiduals(NamedTuple):
    """The residuals of one stretch, 0 where none counts; of two cycles or more laid over."""

    stretch: Stretch
    interval: float  # of the samples, s
    residuals: FloatArray  # (n,), N
    folded: FloatArray = np.empty((0, 0))  # the cycles, (cycles, phases)
    about: FloatArray = np.empty((0, 0))  # what each differs from their mean by


def residuals_by_stretch(linearised: Linearisation) -> list[StretchResiduals]:
    """Return the residuals of each stretch."""
    found = []
    for log, seen in zip(linearised.fit.logs, linearised.logs, strict=True):
        for stretch, place in zip(log.trace.stretches, log.trace.places, strict=True):
            residuals = np.where(seen.weights[place] > 0.0, seen.residuals[place], 0.0)
            part = StretchResiduals(stretch, log.trace.interval, residuals)
            if stretch.n_cycles > 1:
                folded = _fold(residuals, stretch)
                part = part._replace(folded=folded, about=folded - folded.mean(axis=0))
            found.append(part)
    return found


def split_power(parts: Sequence[StretchResiduals]) -> tuple[float, float, Callable[[], bool]]:
    """Return repeating and scattered mean squares, N^2, and whether noise cannot be all of it.

    Where nothing repeats it is misfit and noise by what was found above the filter's band. Noise of
    the displacement is not in that; it makes less than the force's in a usual log.
    """
    cycles = [part for part in parts if part.folded.size]
    if not cycles and any(part.stretch.n_cycles for part in parts):
        return math.nan, math.nan, lambda: False
    n = sum(len(part.residuals) for part in cycles or parts)
    if not cycles:
        noise = sum(len(part.residuals) * part.stretch.noise**2 for part in parts) / n
        whole = sum(float(part.residuals @ part.residuals) for part in parts) / n
        return whole - noise, noise, lambda: whole / max(noise, 1e-300) > _MUCH
    repeats = noise = expected = 0.0
    for part in cycles:
        size, (n_cycles, n_phases) = len(part.residuals), part.folded.shape
        scatter = float(np.sum(part.about**2)) / (n_phases * (n_cycles - 1))
        repeats += size * (float(np.mean(part.folded.mean(axis=0) ** 2)) - scatter / n_cycles)
        expected += size * scatter / n_cycles
        noise += size * scatter
    ratio = 1.0 + repeats / max(expected, 1e-300)
    return repeats / n, noise / n, lambda: is_beyond_chance(parts, ratio)


def is_beyond_chance(parts: Sequence[StretchResiduals], ratio: float) -> bool:
    """Whether the power of the mean cycles over what noise has is beyond chance."""
    phases, others = 0.0, 0.0
    for part in parts:
        if part.about.size:
            worth = independent_phases(part.about)
            phases += worth
            others += worth * (part.stretch.n_cycles - 1)
    return fisher_chance(phases, others, ratio) < _CHANCE


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

    NaN for a single cycle.
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


def _cycle_correlation(part: StretchResiduals) -> float:
    """Autocorrelation at a lag of one cycle; NaN of less than two."""
    residuals, n = part.residuals, len(part.residuals)
    period = round(1.0 / (part.stretch.frequency * part.interval))
    if 2 * period >= n:
        return math.nan
    power = max(float(residuals @ residuals), 1e-300)
    return float(residuals[:-period] @ residuals[period:]) / power * n / (n - period)


def _sign_changes(rows: FloatArray) -> int:
    negative = np.signbit(rows)
    return int(np.count_nonzero(negative[:, 1:] != negative[:, :-1]))


# The settings of a run beside each other, and words


def reconciled(diagnoses: Iterable[Diagnosis]) -> tuple[Diagnosis, ...]:
    """Return the diagnoses of a run without causes that contradict each other.

    The rig's delay and the damper's gas are one for all settings: where a few settings want the
    opposite of what most want, theirs is none, and where opinions are divided, nobody's is.
    """
    found = list(diagnoses)

    def keep(name: str, *, sign: bool | None) -> None:
        for place, one in enumerate(found):
            hints = tuple(h for h in one.hints if h.name != name or (h.amount > 0.0) is sign)
            if hints != one.hints:
                pointer = one.sentence[len(_sentence(one)) :]
                left = replace(one, hints=hints)
                found[place] = replace(left, sentence=_sentence(left) + pointer)

    for name in _IN_COMMON:
        signs = [h.amount > 0.0 for one in found for h in one.hints if h.name == name]
        few, many = sorted((signs.count(True), signs.count(False)))
        if few:
            kept = None if many < _MOST * few else signs.count(True) > signs.count(False)
            keep(name, sign=kept)
    # Half of the logs have no gain beside the others.
    if 2 * sum(h.name == "force_gain" for one in found for h in one.hints) >= len(found):
        keep("force_gain", sign=None)
    return tuple(found)


def _warned(linearised: Linearisation, diagnosis: Diagnosis) -> str:
    """Point to the warnings on these logs that may be the cause."""
    if not diagnosis.is_structured:
        return ""
    # Strokes taken for each other leave the gas force twice: in position.
    is_known = diagnosis.is_met or diagnosis.has_yielded or diagnosis.hints
    may_be = {
        "displacement_noise": diagnosis.noise_percent >= _NOISE_COUNTS * diagnosis.mse_percent,
        "direction": not is_known or any(h.family == "position" for h in diagnosis.hints),
    }
    found = [
        f"{one.name} of {log.trace.name}"
        for fault in _FAULTS_OF_LOGS
        if may_be.get(fault, True)
        for log in linearised.fit.logs
        for one in log.trace.findings
        if one.severity == "warning" and one.name.endswith(fault)
    ]
    more = f" and {len(found) - 1} more" if len(found) > 1 else ""
    return f"; see the warning {found[0]}{more}" if found else ""


def _sentence(diagnosis: Diagnosis) -> str:
    mse, noise, hints = diagnosis.mse_percent, diagnosis.noise_percent, diagnosis.hints
    if math.isnan(noise):
        return f"MSE {mse:.2g} %; a single cycle cannot separate noise from lack of fit"
    said = f"MSE {mse:.2g} %, of which {noise:.2g} % is noise"
    if not diagnosis.is_structured:
        return f"{said}: no misfit repeats"
    yields = _yields(diagnosis) if diagnosis.has_yielded else ""
    if not hints:
        return f"{said}: {yields or 'a misfit repeats, and its cause was not found'}"
    named = " or ".join(hint.words for hint in hints)
    said = f"{said}: a misfit repeats, {100.0 * hints[0].share:.0f} % of it as from {named}"
    return f"{said}; {yields}" if yields and not diagnosis.is_met else said


def _yields(diagnosis: Diagnosis) -> str:
    """What is said of a damper that yields, as the model does where it meets the logs."""
    share = 100.0 * diagnosis.held_share
    holds = f"the damper holds {share:.0f} % of its force down to a tenth of its speed"
    if diagnosis.is_met and diagnosis.modelled_share >= min(YIELDS, 0.9 * diagnosis.held_share):
        return (
            f"{holds}, as a preloaded valve, dry friction or a magneto-rheological fluid does, and "
            "so does the model; a misfit repeats, and its cause was not found"
        )
    return (
        f"{holds}: it yields before it slides, like a preloaded valve, dry friction or a "
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
