"""A family of simulated tests for people: a sentence, a table and the paper's figures 4-9."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.report.plots import Line, Panel, Plot, setting_colours, thin
from damperfit.report.rows import Sheet, number
from damperfit.report.setting_plots import pressure_panel

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from damperfit.characteristics import Characteristics
    from damperfit.simulation import Response

    FloatArray = NDArray[np.float64]

__all__ = [
    "Kin",
    "family_plot",
    "family_records",
    "family_sentence",
    "family_sheet",
    "kin_pressures",
]

_BUCKETS = 300  # a cycle at 1000 Hz stays whole


@dataclass(frozen=True, slots=True, eq=False)
class Kin:
    """One of a family.

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


def family_sheet(name: str, unit: str, family: Sequence[Kin]) -> Sheet:
    """Return one row per member."""
    return Sheet(
        headings=(
            "factor", name, "peak", "peak", "hysteresis", "hysteresis", "energy", "cavitation",
        ),
        units=("", unit, "rebound N", "bump N", "rebound N", "bump N", "J", "% of cycle"),
        rows=tuple(
            (
                f"{kin.factor:g}",
                number(kin.value, digits=5),
                number(kin.figures.peak_force_rebound, digits=4),
                number(kin.figures.peak_force_bump, digits=4),
                number(kin.figures.hysteresis_rebound, digits=4),
                number(kin.figures.hysteresis_bump, digits=4),
                number(kin.figures.energy, digits=4),
                f"{100.0 * kin.cavitation:.1f}",
            )
            for kin in family
        ),
        is_number=(True,) * 8,
    )  # fmt: skip


def family_records(name: str, family: Sequence[Kin]) -> list[dict[str, float | str]]:
    """Return the same as numbers in SI, by column name."""
    return [
        {
            "quantity": name,
            "factor": kin.factor,
            "value": kin.value,
            "peak_force_rebound_N": kin.figures.peak_force_rebound,
            "peak_force_bump_N": kin.figures.peak_force_bump,
            "hysteresis_speed_m_per_s": kin.figures.hysteresis_speed,
            "hysteresis_rebound_N": kin.figures.hysteresis_rebound,
            "hysteresis_bump_N": kin.figures.hysteresis_bump,
            "energy_J": kin.figures.energy,
            **{
                f"cavitation_fraction_{i}": share
                for i, share in enumerate(kin.figures.cavitation_shares, start=1)
            },
        }
        for kin in family
    ]


def family_sentence(name: str, family: Sequence[Kin]) -> str:
    """Return what changes from the lowest to the highest factor, in one sentence."""
    ranked = sorted(family, key=lambda kin: kin.factor)
    first, last = ranked[0], ranked[-1]
    wet = "no chamber cavitates"
    dry = [
        f"chamber {i} for {100.0 * share:.1f} % of the cycle at x{kin.factor:g}"
        for kin in ranked
        for i, share in enumerate(kin.figures.cavitation_shares, start=1)
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


def family_plot(name: str, family: Sequence[Kin], *, file_name: str, title: str) -> Plot:
    """Return the force-velocity loops of a family; x1 in the text colour."""
    colours = setting_colours(range(len(family)))
    lines = []
    for k, kin in enumerate(family):
        cycle = _last_cycle(kin)
        v, f = kin.response.velocity[cycle], kin.response.force[cycle]
        kept = thin(_BUCKETS, v, f)
        colour = "ink" if kin.factor == 1.0 else colours[k]
        lines.append(Line(v[kept], f[kept], f"{name} x{kin.factor:g}", colour))
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    return Plot(file_name, title, (panel,), family_sentence(name, family))


def kin_pressures(kin: Kin, *, file_name: str, title: str) -> Plot:
    """Return the chamber pressures of one member, cavitation shaded."""
    cycle = _last_cycle(kin)
    time = kin.response.time[cycle] - kin.response.time[cycle.start]
    panel = pressure_panel(time, kin.response.pressures[:, cycle])
    return Plot(file_name, title, (panel,), "Shaded: cavitation." if panel.bands else "")


def _last_cycle(kin: Kin) -> slice:
    time = kin.response.time
    start = time[-1] - 1.0 / kin.frequency
    return slice(max(0, int(np.searchsorted(time, start)) - 1), len(time))
