"""The figures of a sweep: its force-velocity loops, and the pressures of one test."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.report.plots.colours import setting_colours
from damperfit.report.plots.description import Line, Panel, Plot, thin
from damperfit.report.plots.one_log import pressure_panel
from damperfit.report.sheets.sweep_sheet import sweep_sentence

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.report.sheets.sweep_sheet import SweepMember

__all__ = ["sweep_plot", "sweep_pressure_plot"]

_BUCKETS = 300  # a cycle at 1000 Hz stays whole


def sweep_plot(name: str, members: Sequence[SweepMember], *, file_name: str, title: str) -> Plot:
    """Return the force-velocity loops of a members; x1 in the text colour."""
    colours = tuple(setting_colours(range(len(members))).values())
    lines = []
    for k, member in enumerate(members):
        cycle = _last_cycle(member)
        v, f = member.response.velocity[cycle], member.response.force[cycle]
        kept = thin(_BUCKETS, v, f)
        colour = "ink" if member.factor == 1.0 else colours[k]
        lines.append(Line(v[kept], f[kept], f"{name} x{member.factor:g}", colour))
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    return Plot(file_name, title, (panel,), sweep_sentence(name, members))


def sweep_pressure_plot(member: SweepMember, *, file_name: str, title: str) -> Plot:
    """Return the chamber pressures of one member, cavitation shaded."""
    cycle = _last_cycle(member)
    time = member.response.time[cycle] - member.response.time[cycle.start]
    panel = pressure_panel(time, member.response.pressures[:, cycle])
    return Plot(file_name, title, (panel,), "Shaded: cavitation." if panel.bands else "")


def _last_cycle(member: SweepMember) -> slice:
    time = member.response.time
    start = time[-1] - 1.0 / member.frequency
    return slice(max(0, int(np.searchsorted(time, start)) - 1), len(time))
