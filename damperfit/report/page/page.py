"""The report as one HTML file: text and tables by us, plots by plotly.js, everything inlined.

Everything that may have come from a log or a configuration is escaped where it enters the page:
`page_text` in HTML, and in plot descriptions, which plotly reads as a small HTML of its own.
The page forbids itself every network request (Content-Security-Policy).
"""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass, field
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit import __version__
from damperfit.errors import InstallationError
from damperfit.report.campaign_plots import campaign_plots
from damperfit.report.page_sheets import result_tables
from damperfit.report.page_summary import setting_verdict, summary_html
from damperfit.report.page_tables import details_html, log_table, page_text, words_html
from damperfit.report.plots import setting_colours
from damperfit.report.rows import parameter_line
from damperfit.report.run_record import told_trends
from damperfit.report.setting_plots import setting_plots
from damperfit.report.views import log_views

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.report.plots import Line, Panel, Plot
    from damperfit.report.views import LogView
    from damperfit.tables import Results

__all__ = ["Portfolio", "html_report", "portfolio"]


@dataclass(frozen=True, slots=True, eq=False)
class Portfolio:
    """Everything that is drawn from a results folder.

    Attributes
    ----------
    results : Results
        The tables.
    colours : mapping of int to str
        Colour of each setting.
    overall : tuple of Plot
        All settings together.
    by_log : tuple of (LogView, tuple of Plot)
        Each log.
    """

    results: Results
    colours: Mapping[int, str]
    overall: tuple[Plot, ...]
    by_log: tuple[tuple[LogView, tuple[Plot, ...]], ...]

    @property
    def plots(self) -> tuple[Plot, ...]:
        """All plots in the order of the report."""
        return (*self.overall, *(plot for _, plots in self.by_log for plot in plots))


def portfolio(results: Results) -> Portfolio:
    """Lay out the plots of a results folder."""
    views = log_views(results)
    colours = setting_colours(
        [
            *(row["setting"] for row in results.parameters),
            *(row["setting"] for row in results.mse),
            *(view.signals.setting for view in views),
        ]
    )
    overall = campaign_plots(
        *(results.parameters, results.mse, views),
        colours=colours,
        trends=told_trends(results.record),
    )
    by_log = []
    counts: dict[int, int] = {}
    for view in views:
        setting = view.signals.setting
        counts[setting] = counts.get(setting, 0) + 1
        more = f"_log_{counts[setting]}" if counts[setting] > 1 else ""
        name = f"setting_{setting:02d}{more}"
        by_log.append((view, setting_plots(view, name=name, colour=colours[setting])))
    return Portfolio(results, colours, overall, tuple(by_log))


def html_report(shown: Portfolio, *, title: str) -> str:
    """Return the report as one self-contained HTML page.

    Parameters
    ----------
    shown : Portfolio
        What to show.
    title : str
        Heading, as a rule the name of the folder; escaped here.

    Raises
    ------
    InstallationError
        plotly is not installed.
    """
    store = _Store()
    overall = "".join(_figure(plot, store) for plot in shown.overall)
    rows = {row["setting"]: row for row in shown.results.parameters}
    logs = "".join(
        _log_section(view, plots, store, rows.get(view.signals.setting))
        for view, plots in shown.by_log
    )
    document = {
        "arrays": store.arrays,
        "plots": store.plots,
        "colours": {str(setting): colour for setting, colour in shown.colours.items()},
    }
    parts = {
        "title": page_text(title),
        "version": page_text(__version__),
        "style": _asset("page.css"),
        "summary": summary_html(shown.results, [view for view, _ in shown.by_log]),
        "tables": result_tables(shown.results) or "<p>No table could be read.</p>",
        "chips": _chips(shown.colours),
        "places": _places(shown),
        "overall": overall or "<p>No table of settings could be read.</p>",
        "logs": logs or "<p>No signals could be read.</p>",
        "data": _json(document),
        "plotly": _plotly_script(),
        "script": _asset("page.js"),
    }
    page = _asset("page.html")
    head, *rest = page.split("{{")  # one pass, so that no part can hold a mark of another
    pieces = [head]
    for piece in rest:
        key, _, text = piece.partition("}}")
        pieces += [parts[key], text]
    return "".join(pieces)


def _asset(name: str) -> str:
    return (resources.files("damperfit.report") / name).read_text(encoding="utf-8")


def _plotly_script() -> str:
    """Return plotly.js out of the Python package, which need not be imported for it."""
    spec = find_spec("plotly")
    for place in spec.submodule_search_locations or () if spec else ():
        path = Path(place) / "package_data" / "plotly.min.js"
        if path.is_file():
            return path.read_text(encoding="utf-8").replace("</script", "<\\/script")
    raise InstallationError("the report needs plotly; install it with: pip install plotly")


@dataclass(slots=True)
class _Store:
    """Arrays of the page, each once, and the plots that point to them."""

    arrays: list[str] = field(default_factory=list)
    places: dict[bytes, int] = field(default_factory=dict)
    plots: list[dict[str, Any]] = field(default_factory=list)

    def add(self, values: NDArray[np.float64] | None) -> int | None:
        """Return the place of an array, kept as base64 of 32-bit floats: 7 digits, no loss seen."""
        if values is None:
            return None
        data = np.ascontiguousarray(values, dtype="<f4").tobytes()
        if data not in self.places:
            self.places[data] = len(self.arrays)
            self.arrays.append(base64.b64encode(data).decode("ascii"))
        return self.places[data]


def _figure(plot: Plot, store: _Store) -> str:
    place = len(store.plots)
    panels = [_panel(panel, store) for panel in plot.panels]
    store.plots.append(
        {
            "name": plot.name,
            "title": page_text(plot.title),
            "panels": panels,
            "keyed": bool(plot.key),
        }
    )
    caption = f"<figcaption>{page_text(plot.caption)}</figcaption>" if plot.caption else ""
    tall = " tall" if len(plot.panels) > 1 else ""
    return (
        f'<figure><h3>{page_text(plot.title)}</h3><div class="plot{tall}" id="plot-{place}" '
        f'data-name="{page_text(plot.name)}"></div>{caption}</figure>\n'
    )


def _panel(panel: Panel, store: _Store) -> dict[str, Any]:
    return {
        "x": [panel.x_label, panel.x_unit],
        "y": [panel.y_label, panel.y_unit],
        "rules": panel.rules,
        "bands": panel.bands,
        "log": panel.is_log,
        "ticks": panel.ticks,
        "xrange": panel.x_range,
        "yrange": panel.y_range,
        "lines": [_line(line, store) for line in panel.lines],
    }


def _line(line: Line, store: _Store) -> dict[str, Any]:
    return {
        "x": store.add(line.x),
        "y": store.add(line.y),
        "label": page_text(line.label),
        "colour": line.colour,
        "setting": line.setting,
        "style": line.style,
        "legend": line.in_legend,
        "up": store.add(None if line.high is None else line.high - line.y),
        "down": store.add(None if line.low is None else line.y - line.low),
    }


def _json(document: Any) -> str:
    """Return JSON that cannot end the script element it stands in."""
    text = json.dumps(document, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def _chips(colours: Mapping[int, str]) -> str:
    return "".join(
        f'<label style="--c:{colour}"><input type="checkbox" checked data-setting="{setting}">'
        f"{setting}</label>"
        for setting, colour in colours.items()
    )


def _places(shown: Portfolio) -> str:
    settings = dict.fromkeys(view.signals.setting for view, _ in shown.by_log)
    return "".join(f'<option value="{setting}">{setting}</option>' for setting in settings)


def _log_section(
    view: LogView, plots: Sequence[Plot], store: _Store, row: Mapping[str, Any] | None
) -> str:
    signals = view.signals
    figures = "".join(_figure(plot, store) for plot in plots)
    temperature = (
        "temperature not logged" if view.temperature is None else f"{view.temperature:.1f} degC"
    )
    frequency = f"{view.frequency:.3g} Hz" if np.isfinite(view.frequency) else "frequency unknown"
    amplitude = f"amplitude {1e3 * view.amplitude:.3g} mm"
    facts = f"{frequency}, {amplitude}, {temperature}, {len(signals.time)} samples evaluated."
    verdict = f"Fit of the setting: {setting_verdict(row)}. {parameter_line(row)}" if row else ""
    grave = [f"{f.severity}: {f.sentence}" for f in view.findings if f.severity != "note"]
    notes = [f.sentence for f in view.findings if f.severity == "note"]
    return (
        f'<section class="log" data-setting="{signals.setting}">'
        f"<h2>Setting {signals.setting}: {page_text(signals.log)}</h2>"
        f'<p class="lead">{page_text(verdict)}</p><p>{page_text(facts)}</p>'
        f"{words_html('Findings', grave)}"
        f"{details_html('Notes on the log', notes)}"
        f"{details_html('How the log was read', view.notes)}"
        f'<div class="grid">{figures}<figure><h3>Setting {signals.setting}: forces</h3>'
        f"{log_table(view)}</figure></div></section>\n"
    )
