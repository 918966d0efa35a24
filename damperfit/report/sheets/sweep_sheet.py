"""What a sweep of one quantity does: a row per factor, records for a file, and a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.report.sheets.rounding import number
from damperfit.report.sheets.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.simulation import Characteristics, Response

__all__ = ["SweepMember", "sweep_records", "sweep_sentence", "sweep_sheet"]


@dataclass(frozen=True, slots=True, eq=False)
class SweepMember:
    """One test of a sweep.

    Attributes
    ----------
    factor, value : float
        The factor and the quantity it makes, SI.
    frequency : float
        Hz.
    response : Response
        Signals of the test.
    figures : Characteristics
        Figures of the last cycle.
    """

    factor: float
    value: float
    frequency: float
    response: Response
    figures: Characteristics

    @property
    def cavitation(self) -> float:
        """Largest share of the cycle that a chamber is at zero pressure."""
        return max(self.figures.cavitation_shares)


def sweep_sheet(name: str, unit: str, members: Sequence[SweepMember]) -> Sheet:
    """Return one row per member."""
    return Sheet(
        headings=(
            "factor", name, "peak", "peak", "hysteresis", "hysteresis", "energy", "cavitation",
        ),
        units=("", unit, "rebound N", "bump N", "rebound N", "bump N", "J", "% of cycle"),
        rows=tuple(
            (
                f"{member.factor:g}",
                number(member.value, digits=5),
                number(member.figures.peak_force_rebound, digits=4),
                number(member.figures.peak_force_bump, digits=4),
                number(member.figures.hysteresis_rebound, digits=4),
                number(member.figures.hysteresis_bump, digits=4),
                number(member.figures.energy, digits=4),
                f"{100.0 * member.cavitation:.1f}",
            )
            for member in members
        ),
        is_number=(True,) * 8,
    )  # fmt: skip


def sweep_records(name: str, members: Sequence[SweepMember]) -> list[dict[str, float | str]]:
    """Return the same as numbers in SI, by column name."""
    return [
        {
            "quantity": name,
            "factor": member.factor,
            "value": member.value,
            "peak_force_rebound_N": member.figures.peak_force_rebound,
            "peak_force_bump_N": member.figures.peak_force_bump,
            "hysteresis_speed_m_per_s": member.figures.hysteresis_speed,
            "hysteresis_rebound_N": member.figures.hysteresis_rebound,
            "hysteresis_bump_N": member.figures.hysteresis_bump,
            "energy_J": member.figures.energy,
            **{
                f"cavitation_fraction_{i}": share
                for i, share in enumerate(member.figures.cavitation_shares, start=1)
            },
        }
        for member in members
    ]


def sweep_sentence(name: str, members: Sequence[SweepMember]) -> str:
    """Return what changes from the lowest to the highest factor, in one sentence."""
    ranked = sorted(members, key=lambda member: member.factor)
    first, last = ranked[0], ranked[-1]
    wet = "no chamber cavitates"
    dry = [
        f"chamber {i} for {100.0 * share:.1f} % of the cycle at x{member.factor:g}"
        for member in ranked
        for i, share in enumerate(member.figures.cavitation_shares, start=1)
        if share > 0.0
    ]
    cavitation = f"cavitation: {', '.join(dry)}" if dry else wet
    if len(ranked) == 1:
        return f"{name} x{first.factor:g}: {cavitation}."

    def change(words: str, get: Callable[[Characteristics], float]) -> str:
        before, after = abs(get(first.figures)), abs(get(last.figures))
        share = (
            f" ({round(100.0 * (after / before - 1.0), 1) + 0.0:+.1f} %)" if before > 0.0 else ""
        )
        return f"{words} {number(before, digits=4)} to {number(after, digits=4)} N{share}"

    changes = (
        change("peak rebound", lambda f: f.peak_force_rebound),
        change("peak bump", lambda f: f.peak_force_bump),
        change("hysteresis in rebound", lambda f: f.hysteresis_rebound),
        change("in bump", lambda f: f.hysteresis_bump),
    )
    return f"{name} x{first.factor:g} to x{last.factor:g}: {', '.join(changes)}; {cavitation}."
