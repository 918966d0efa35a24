"""A simulated cycle and a sweep: their tables, lines for a terminal, and figures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from damperfit.adjustment.force_at import STROKE_WORDS
from damperfit.reporting.figures import (
    Line,
    Panel,
    Plot,
    loop,
    pressure_panel,
    setting_colours,
)
from damperfit.reporting.sheet import Column, Sheet, laid_out, number
from damperfit.reporting.tables import BLOCK_LEVELS, sparkline
from damperfit.simulation import Characteristics, Response

_BRANCHES = "force at a speed: mean of both branches; hysteresis: opening less closing branch"
_BAR = 1e5  # Pa
_CELLS, _FEWEST = 44, 16  # characters of one cycle; where the terminal is narrow
_BESIDE = 36  # name and range of a line
_BLUE = "#0072b2"


# A simulated cycle


def cycle_force_sheet(figures: Characteristics, trust: str = "") -> Sheet:
    """Return peak forces, hysteresis and forces at named speeds; below, how far to trust them."""
    hysteresis = f"hysteresis at {figures.hysteresis_speed:.3g} m/s"
    rows: list[tuple[str, str, float | None, float | None]] = [
        ("peak force", "N", figures.peak_force_rebound, figures.peak_force_bump),
        ("peak speed", "m/s", figures.peak_speed_rebound, figures.peak_speed_bump),
        *((f"force at {f.speed:g} m/s", "N", f.rebound, f.bump) for f in figures.speed_forces),
        (hysteresis, "N", figures.hysteresis_rebound, figures.hysteresis_bump),
    ]
    cells = [(a, b, *(number(one, digits=4) for one in pair)) for a, b, *pair in rows]
    cells.append(("energy per cycle", "J", number(figures.energy, digits=4), ""))
    notes = (_BRANCHES, *[trust] * bool(trust))
    is_number = (False, False, True, True)
    return Sheet(("", "", *STROKE_WORDS.values()), ("",) * 4, tuple(cells), is_number, notes)


def cycle_pressure_sheet(figures: Characteristics) -> Sheet:
    """Return the pressure range and the share of the cycle in cavitation, by chamber."""
    low, high = (
        tuple(number(p[end] / _BAR, digits=4) for p in figures.pressure_ranges) for end in (0, 1)
    )
    rows = (
        ("lowest pressure", "bar", *low),
        ("highest pressure", "bar", *high),
        ("cavitation", "% of cycle", *(f"{100.0 * one:.1f}" for one in figures.cavitation_shares)),
    )
    headings = ("", "", "chamber 1", "chamber 2", "chamber 3")
    return Sheet(headings, ("",) * 5, rows, (False, False, True, True, True))


def cycle_sparklines(
    response: Response, frequency: float, *, columns: int = 80, levels: str = BLOCK_LEVELS
) -> tuple[str, ...]:
    """Return the last cycle, of ``frequency`` Hz, as lines: displacement, force, pressures."""
    cells = max(_FEWEST, min(_CELLS, columns - _BESIDE))
    at = response.time[-1] - (1.0 - np.arange(cells) / (cells - 1.0)) / frequency
    is_inside = response.time >= at[0]
    signals = {
        ("displacement", "mm"): 1e3 * response.displacement,
        ("force", "N"): response.force,
        **{(f"pressure {i}", "bar"): p / _BAR for i, p in enumerate(response.pressures, start=1)},
    }
    lines = []
    for (name, unit), signal in signals.items():
        if np.isfinite(signal).all():
            course = sparkline(np.interp(at, response.time, signal).tolist(), levels=levels)
            inside = signal[is_inside]
            low, high = (number(float(end), digits=4) for end in (inside.min(), inside.max()))
            lines.append(f"{name:<12} {course} {low} to {high} {unit}")
    return tuple(lines)


def cycle_plot(response: Response, frequency: float, *, title: str = "") -> Plot:
    """Return force against displacement and velocity over the last cycle, of ``frequency`` Hz."""
    last = response.time >= response.time[-1] - (1.0 + 1e-9) / frequency
    force = response.force[last]
    panels = tuple(
        Panel(f"{word} (positive: rebound)", unit, "force", "N",
              (Line(signal[last], force, "force", _BLUE),))
        for word, unit, signal in (
            ("displacement", "mm", 1e3 * response.displacement),
            ("velocity", "m/s", response.velocity),
        )
    )  # fmt: skip
    return Plot("cycle", title, panels)


# A sweep


@dataclass(frozen=True, slots=True, eq=False)
class SweepMember:
    """One test of a sweep."""

    factor: float
    value: float  # the quantity that the factor makes, SI
    frequency: float  # Hz
    response: Response
    figures: Characteristics  # of the last cycle

    @property
    def cavitation(self) -> float:
        """Largest share of the cycle that a chamber is at zero pressure."""
        return max(self.figures.cavitation_shares)

    @property
    def last_cycle(self) -> slice:
        """The samples of the last cycle."""
        time = self.response.time
        start = int(np.searchsorted(time, time[-1] - 1.0 / self.frequency))
        return slice(max(0, start - 1), len(time))


# Heading, unit and key of each figure of a member, what it is in `Characteristics` and in words.
_SWEPT = (
    ("peak", "rebound N", "peak_force_rebound_N", "peak_force_rebound", "peak rebound"),
    ("peak", "compr. N", "peak_force_bump_N", "peak_force_bump", "peak compression"),
    ("", "", "hysteresis_speed_m_per_s", "hysteresis_speed", ""),
    ("hyst.", "rebound N", "hysteresis_rebound_N", "hysteresis_rebound", "hysteresis in rebound"),
    ("hyst.", "compr. N", "hysteresis_bump_N", "hysteresis_bump", "in compression"),
    ("energy", "J", "energy_J", "energy", ""),
)


def sweep_sheet(name: str, unit: str, members: Sequence[SweepMember]) -> Sheet:
    """Return one row per member: peaks, hysteresis, energy, cavitation."""

    def shown(figure: str) -> Callable[[SweepMember], str]:
        return lambda member: number(getattr(member.figures, figure), digits=4)

    columns = [
        Column("factor", "", lambda member: f"{member.factor:g}"),
        Column(name, unit, lambda member: number(member.value, digits=5)),
        *(Column(heading, of, shown(figure)) for heading, of, _, figure, _ in _SWEPT if heading),
        Column("cavitation", "% of cycle", lambda member: f"{100.0 * member.cavitation:.1f}"),
    ]
    return laid_out(members, columns)


def sweep_records(name: str, members: Sequence[SweepMember]) -> list[dict[str, float | str]]:
    """Return the same as numbers in SI, by column name."""
    return [
        {
            "quantity": name,
            "factor": member.factor,
            "value": member.value,
            **{key: getattr(member.figures, figure) for _, _, key, figure, _ in _SWEPT},
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
    dry = [
        f"chamber {i} for {100.0 * share:.1f} % of the cycle at x{member.factor:g}"
        for member in ranked
        for i, share in enumerate(member.figures.cavitation_shares, start=1)
        if share > 0.0
    ]
    cavitation = f"cavitation: {', '.join(dry)}" if dry else "no chamber cavitates"
    if len(ranked) == 1:
        return f"{name} x{first.factor:g}: {cavitation}."
    changes = []
    for *_, figure, words in _SWEPT:
        if words:
            before, after = (abs(getattr(one.figures, figure)) for one in (first, last))
            gain = round(100.0 * (after / before - 1.0), 1) + 0.0 if before > 0.0 else None
            share_of = "" if gain is None else f" ({gain:+.1f} %)"
            both = f"{number(before, digits=4)} to {number(after, digits=4)} N"
            changes.append(f"{words} {both}{share_of}")
    return f"{name} x{first.factor:g} to x{last.factor:g}: {', '.join(changes)}; {cavitation}."


def sweep_plot(name: str, members: Sequence[SweepMember], *, file_name: str, title: str) -> Plot:
    """Return the force-velocity loops of a sweep's members; x1 in the text colour."""
    lines = []
    for member, colour in zip(members, setting_colours(range(len(members))).values(), strict=True):
        ink = "ink" if member.factor == 1.0 else colour
        signals = (member.response.velocity, member.response.force)
        lines.append(Line(*loop(*signals, member.last_cycle), f"{name} x{member.factor:g}", ink))
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    return Plot(file_name, title, (panel,), sweep_sentence(name, members))


def sweep_pressure_plot(member: SweepMember, *, file_name: str, title: str) -> Plot:
    """Return the chamber pressures of one member, cavitation shaded."""
    response = member.response
    panel = pressure_panel(response.time, response.pressures, member.last_cycle)
    return Plot(file_name, title, (panel,), "Shaded: cavitation." if panel.bands else "")
