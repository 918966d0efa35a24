"""All plots of a results folder, in the order of the report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.report.evaluated_log import evaluate_logs
from damperfit.report.json_records import trends_in, units_in
from damperfit.report.plots.all_settings import campaign_plots
from damperfit.report.plots.colours import setting_colours
from damperfit.report.plots.in_units import plot_in_units
from damperfit.report.plots.one_log import setting_plots
from damperfit.report.plots.valves import valve_plots
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.report.evaluated_log import EvaluatedLog
    from damperfit.report.plots.description import Plot
    from damperfit.tables import Results
    from damperfit.tested.setting import Setting

__all__ = ["ReportPlots", "report_plots"]


@dataclass(frozen=True, slots=True, eq=False)
class ReportPlots:
    """Everything that is drawn from a results folder.

    Attributes
    ----------
    results : Results
        The tables.
    colours : mapping of Setting to str
        Colour of each setting.
    overall : tuple of Plot
        All settings together.
    by_log : tuple of (EvaluatedLog, tuple of Plot)
        Each log.
    units : ShownUnits
        Of the plots; the logs are in SI.
    """

    results: Results
    colours: Mapping[Setting, str]
    overall: tuple[Plot, ...]
    by_log: tuple[tuple[EvaluatedLog, tuple[Plot, ...]], ...]
    units: ShownUnits = SI

    @property
    def plots(self) -> tuple[Plot, ...]:
        """All plots in the order of the report."""
        return (*self.overall, *(plot for _, plots in self.by_log for plot in plots))


def report_plots(results: Results, units: ShownUnits | None = None) -> ReportPlots:
    """Lay out the plots of a results folder.

    Parameters
    ----------
    results : Results
        The folder.
    units : ShownUnits or None
        Of forces, speeds and displacements; None: those of the run.
    """
    units = units_in(results.record) if units is None else units
    logs = evaluate_logs(results)
    colours = setting_colours(
        [
            *(row["setting"] for row in results.parameters),
            *(row["setting"] for row in results.mse),
            *(log.signals.setting for log in logs),
        ]
    )
    overall = campaign_plots(
        *(results.parameters, results.mse, logs),
        colours=colours,
        trends=trends_in(results.record),
        quantities=results.quantities,
    )
    by_log = []
    counts: dict[Setting, int] = {}
    for log in logs:
        setting = log.signals.setting
        counts[setting] = counts.get(setting, 0) + 1
        more = f"_log_{counts[setting]}" if counts[setting] > 1 else ""
        name = f"setting_{setting.slug}{more}"
        plots = setting_plots(log, name=name, colour=colours[setting])
        if counts[setting] == 1:  # the valves are those of all its logs
            plots = (*plots, *valve_plots(results.valves, setting, colour=colours[setting]))
        by_log.append((log, plots))
    overall = tuple(plot_in_units(plot, units) for plot in overall)
    shown = tuple((log, tuple(plot_in_units(p, units) for p in plots)) for log, plots in by_log)
    return ReportPlots(results, colours, overall, shown, units)
