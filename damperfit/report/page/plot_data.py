"""Plots as the page's script reads them: descriptions, and each array once."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import InstallationError
from damperfit.report.page.templating import page_text, verbatim
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Mapping

    from markupsafe import Markup
    from numpy.typing import NDArray

    from damperfit.report.plots.description import Line, Panel, Plot

__all__ = ["Figure", "PlotData", "plotly_script"]


@dataclass(frozen=True, slots=True)
class Figure:
    """Where a plot stands on the page.

    Attributes
    ----------
    place : int
        Number of the plot in the data.
    name, title, caption : str
        Of the plot, not yet escaped.
    is_tall : bool
        It has more than one panel.
    """

    place: int
    name: str
    title: str
    caption: str
    is_tall: bool


@dataclass(slots=True)
class PlotData:
    """Arrays of the page, each once, and the plots that point to them."""

    arrays: list[str] = field(default_factory=list)
    places: dict[bytes, int] = field(default_factory=dict)
    plots: list[dict[str, Any]] = field(default_factory=list)

    def add(self, plot: Plot) -> Figure:
        """Keep a plot, and return where it is drawn."""
        panels = [self._panel(panel) for panel in plot.panels]
        self.plots.append(
            {
                "name": plot.name,
                "title": page_text(plot.title),
                "panels": panels,
                "keyed": bool(plot.key),
            }
        )
        place = len(self.plots) - 1
        return Figure(place, plot.name, plot.title, plot.caption, len(plot.panels) > 1)

    def script(self, colours: Mapping[Setting, str]) -> Markup:
        """Return everything as JSON that cannot end the script element it stands in."""
        document = {
            "arrays": self.arrays,
            "plots": self.plots,
            "colours": {str(setting): colour for setting, colour in colours.items()},
        }
        text = json.dumps(document, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
        return verbatim(text.replace("<", "\\u003c"))

    def _array(self, values: NDArray[np.float64] | None) -> int | None:
        """Return the place of an array, kept as base64 of 32-bit floats: 7 digits, no loss seen."""
        if values is None:
            return None
        data = np.ascontiguousarray(values, dtype="<f4").tobytes()
        if data not in self.places:
            self.places[data] = len(self.arrays)
            self.arrays.append(base64.b64encode(data).decode("ascii"))
        return self.places[data]

    def _panel(self, panel: Panel) -> dict[str, Any]:
        return {
            "x": [panel.x_label, panel.x_unit],
            "y": [panel.y_label, panel.y_unit],
            "rules": panel.rules,
            "bands": panel.bands,
            "log": panel.is_log,
            "ticks": panel.ticks,
            **({"names": panel.names, "labels": panel.tick_labels} if panel.names else {}),
            "xrange": panel.x_range,
            "yrange": panel.y_range,
            "lines": [self._line(line) for line in panel.lines],
        }

    def _line(self, line: Line) -> dict[str, Any]:
        return {
            "x": self._array(line.x),
            "y": self._array(line.y),
            "label": page_text(line.label),
            "colour": line.colour,
            "setting": None if line.setting is None else Setting.of(line.setting).cell,
            "style": line.style,
            "legend": line.in_legend,
            "up": self._array(None if line.high is None else line.high - line.y),
            "down": self._array(None if line.low is None else line.y - line.low),
        }


def plotly_script() -> Markup:
    """Return plotly.js out of the Python package, which need not be imported for it.

    Raises
    ------
    InstallationError
        plotly is not installed.
    """
    spec = find_spec("plotly")
    for place in spec.submodule_search_locations or () if spec else ():
        path = Path(place) / "package_data" / "plotly.min.js"
        if path.is_file():
            text = path.read_text(encoding="utf-8")
            return verbatim(text.replace("</script", "<\\/script"))
    raise InstallationError("the report needs plotly; install it with: pip install plotly")
