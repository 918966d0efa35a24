"""Where and when a chamber of a damper is empty, or how far it is from that."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Trace
    from damperfit.simulation import Response
    from damperfit.tested.setting import Setting

__all__ = ["Cavitation", "describe_cavitation", "emptiest", "seen_cavitation"]


@dataclass(frozen=True, slots=True)
class Cavitation:
    """How far one setting's logs are from cavitation, with the fitted parameters.

    Attributes
    ----------
    fraction : float
        Share of the compared time with a chamber at zero pressure.
    lowest_pressure : float
        Lowest absolute pressure of any chamber in the compared time, Pa.
    chamber : int
        Where: chamber 1, 2 or 3.
    displacement, velocity : float
        When: x and v at that moment, m and m/s. Of a chamber at zero: when it gets there.
    r_m3_margin : float
        Fraction by which R_m3 may rise before a chamber cavitates on this motion; negative when
        it must fall, NaN where no factor from 1/1000 to 1000 is at the edge.
    safe_gas_pressure : float
        Gas pressure P_0 at which a chamber just reaches zero on this motion, all else as it is,
        absolute, Pa; NaN likewise. A lower one cavitates.
    """

    fraction: float = math.nan
    lowest_pressure: float = math.nan
    chamber: int = 0
    displacement: float = math.nan
    velocity: float = math.nan
    r_m3_margin: float = math.nan
    safe_gas_pressure: float = math.nan

    @property
    def margin(self) -> float:
        """Fraction by which the resistance may rise that empties a chamber; as `r_m3_margin`."""
        return self.r_m3_margin


_DOUBT = "; the model does not match these logs, so the damper itself may be full"


def describe_cavitation(
    settings: Mapping[Setting, Cavitation], *, doubted: Collection[Setting] = ()
) -> tuple[str, ...]:
    """Return what there is to say of cavitation, a sentence each: those that do, then the rest.

    Parameters
    ----------
    settings : mapping of Setting to Cavitation
        What the fitted model shows.
    doubted : collection of Setting
        Settings whose logs the model does not match: there its empty chamber is no evidence, and
        nothing is advised against it.
    """
    empty = {setting: one for setting, one in settings.items() if one.fraction > 0.0}
    full = {setting: one for setting, one in settings.items() if one.fraction == 0.0}
    said = [
        f"setting {setting}: {_share(one.fraction)} of the cycle with chamber {one.chamber} at "
        f"zero pressure, {_moment(one, 'from')}{_DOUBT if setting in doubted else _needed(one)}"
        for setting, one in sorted(empty.items())
    ]
    if full:
        said.append(_nearest(full, "no chamber cavitates" if not empty else "elsewhere none does"))
    return tuple(said)


def _nearest(full: Mapping[Setting, Cavitation], opening: str) -> str:
    """The settings that do not cavitate, by the one that is nearest to it."""
    setting = min(full, key=lambda setting: full[setting].lowest_pressure)
    one = full[setting]
    words = (
        f"{opening}; lowest pressure {one.lowest_pressure / 1e5:.2f} bar absolute, in chamber "
        f"{one.chamber} of setting {setting}, {_moment(one, 'at')}"
    )
    if math.isnan(one.r_m3_margin) or math.isnan(one.safe_gas_pressure):
        return words
    return (
        f"{words}; there R_m3 may rise by {_share(one.r_m3_margin)}, or the gas pressure "
        f"fall to {one.safe_gas_pressure / 1e5:.2f} bar absolute, until a chamber cavitates on "
        "this motion"
    )


def _moment(one: Cavitation, word: str) -> str:
    stroke = "rebound" if one.velocity > 0.0 else "bump"
    return (
        f"{word} x = {1e3 * one.displacement:+.0f} mm, v = {one.velocity:+.2f} m/s of the {stroke}"
    )


def _needed(one: Cavitation) -> str:
    if math.isnan(one.safe_gas_pressure):
        return ""
    by_valve = f", or R_m3 lower by {_share(-one.r_m3_margin)},"
    return (
        f"; it takes a gas pressure of {one.safe_gas_pressure / 1e5:.2f} bar absolute"
        f"{'' if math.isnan(one.r_m3_margin) else by_valve} to keep it full"
    )


def _share(fraction: float) -> str:
    return f"{100.0 * fraction:.2g} %"


def seen_cavitation(seen: Sequence[tuple[Trace, Response]]) -> Cavitation:
    """Return what the pressures of a setting's logs show."""
    trace, pressures, chamber, moment = emptiest(seen)
    lowest, fraction = float(pressures.min()), 0.0
    if lowest <= 0.0:
        empty = [(r.pressures[:, t.compared] <= 0.0).any(axis=0) for t, r in seen]
        fraction = float(np.mean(np.concatenate(empty)))
    return Cavitation(
        fraction=fraction,
        lowest_pressure=lowest,
        chamber=chamber + 1,
        displacement=float(trace.displacement[moment]),
        velocity=float(trace.velocity[moment]),
    )


def emptiest(
    seen: Sequence[tuple[Trace, Response]],
) -> tuple[Trace, NDArray[np.float64], int, int]:
    """Return the log with the lowest pressure, its compared pressures, chamber (from 0), sample."""
    trace, response = seen[0]
    if len(seen) > 1:
        trace, response = min(
            seen, key=lambda pair: float(pair[1].pressures[:, pair[0].compared].min())
        )
    part = trace.compared
    pressures = response.pressures[:, part]
    chamber, sample = _emptiest(pressures)
    moment = part.start + sample if isinstance(part, slice) else part[sample]
    return trace, pressures, chamber, int(moment)


def _emptiest(pressures: NDArray[np.float64]) -> tuple[int, int]:
    """Chamber (from 0) and sample of the lowest pressure, or of the longest time at zero."""
    chamber, sample = np.unravel_index(int(np.argmin(pressures)), pressures.shape)
    if pressures[chamber, sample] > 0.0:
        return int(chamber), int(sample)
    is_empty = pressures <= 0.0
    longest = int(np.argmax(np.count_nonzero(is_empty, axis=1)))
    begins = np.flatnonzero(np.diff(is_empty[longest].astype(np.int8)) > 0)
    return longest, int(begins[0]) + 1 if len(begins) else 0
