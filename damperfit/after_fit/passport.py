"""The passport of one damper: an A4 page that prints, and a JSON that is a baseline too."""

from __future__ import annotations

import base64
import json
import re
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from damperfit import __version__
from damperfit.queries.compared_runs import baseline_text, read_run
from damperfit.reporting.drawing import draw_plot
from damperfit.reporting.forces import force_sheets
from damperfit.reporting.report import lead
from damperfit.reporting.run_figures import report_plots
from damperfit.reporting.sheet import html_table, rows_in_units, sheet_in_units
from damperfit.reporting.tables import parameter_sheet
from damperfit.results import entries_in
from damperfit.store import check_writable, write_text
from damperfit.tables.files import json_values

if TYPE_CHECKING:
    from typing import Any

    from damperfit.results import Run
    from damperfit.units.shown_units import ShownUnits

_STYLE = """
@page { size: A4; margin: 10mm }
body { font: 7.5pt sans-serif; max-width: 190mm; margin: 0 auto; color: #111 }
h1 { font-size: 13pt; margin: 0 0 1mm } h2 { font-size: 8.5pt; margin: 2mm 0 .5mm }
table { border-collapse: collapse; font-size: 6pt; width: 100% }
td, th { border-bottom: .1mm solid #bbb; padding: .1mm .6mm; text-align: right }
td { white-space: nowrap }
th { font-weight: normal; background: #eee } td:first-child, th:first-child { text-align: left }
img { display: block; height: 62mm; margin: 1mm auto } p { margin: .4mm 0 }
.two { display: flex; gap: 4mm; align-items: flex-start } .two > * { flex: 1 }
.logs { columns: 2; font-size: 4.5pt } code { font-size: 4.5pt }
"""
_TITLES = ("damper", "serial", "customer", "operator", "date", "rig")
_MANY = 40  # logs that are listed by their hash on the page; the JSON has all


def write_passport(run: Run, folder: Path, units: ShownUnits) -> tuple[Path, Path]:
    """Write passport_NAME.html and .json into a folder; NAME is the serial number, or the run's."""
    title = run.identity.get("serial") or run.identity.get("damper") or run.name
    stem = f"passport_{re.sub(r'[^A-Za-z0-9._-]+', '_', Path(title).name) or 'damper'}"
    document: dict[str, Any] = json.loads(baseline_text(read_run(run.place or run.folder)))
    logs = entries_in(run.record, "inputs")
    document["passport"] = {
        "identity": dict(run.identity),
        "lead": lead(run),
        "damper": run.damper.plain.sentence,
        "temperatures_degC": run.tested.temperatures,
        "checks": run.record.get("checks", []),
        "logs": {str(one.get("log")): one.get("sha256") for one in logs},
        "clicks": run.forces.to_dict("records"),
    }
    page, record = folder / f"{stem}.html", folder / f"{stem}.json"
    check_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_text(record, json.dumps(json_values(document), indent=1, allow_nan=False) + "\n")
    write_text(page, _page(run, title, document["passport"], units))
    return page, record


def _page(run: Run, title: str, known: dict[str, Any], units: ShownUnits) -> str:
    identity = (
        f"{one}: <b>{escape(run.identity[one])}</b>" for one in _TITLES if run.identity.get(one)
    )
    tested = "temperature of the tests not known"
    if known["temperatures_degC"]:
        tested = "tested at {:.0f} to {:.0f} &deg;C".format(*known["temperatures_degC"])
    passed = [bool(one["passed"]) for one in known["checks"]]
    failed = [f"{one['name']}: {one['reason']}" for one in known["checks"] if not one["passed"]]
    hashes = [
        f"{escape(log)} <code>{escape(str(sha))}</code>" for log, sha in known["logs"].items()
    ]
    forces = force_sheets(rows_in_units(run.rows("adjustment"), units))
    tables = [
        html_table(sheet_in_units(sheet, units)) if sheet.rows else ""
        for sheet in (*forces, parameter_sheet(run.rows("parameters"), run.quantities))
    ]
    parts = [
        f"<h1>{escape(title)}</h1>",
        f"<p>{' &middot; '.join(identity)}</p>",
        f"<p>{escape(known['lead'])}</p>",
        f"<p>{escape(known['damper'])}; {tested}</p>",
        "<div class=two>",
        *tables[:-1],
        "</div>",
        _picture(run),
        tables[-1],
        f"<h2>Checks: {sum(passed)} of {len(passed)} passed</h2>",
        *(f"<p>{escape(sentence)}</p>" for sentence in failed),
        "<h2>Logs and their SHA-256</h2><p class=logs>",
        "<br>".join(hashes[:_MANY]),
        f"<br>and {len(hashes) - _MANY} more, in the JSON" if len(hashes) > _MANY else "",
        f"</p><p>&plusmn; is a 95 % interval. damperfit {__version__}</p>",
    ]
    return (
        "<!doctype html>\n<html lang=en><meta charset=utf-8>\n"
        "<meta http-equiv=Content-Security-Policy "
        "content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:\">\n"
        f"<title>{escape(title)}</title><style>{_STYLE}</style>\n<body>\n"
        + "\n".join(filter(None, parts))
        + "\n</body></html>\n"
    )


def _picture(run: Run) -> str:
    """Force against velocity of all settings."""
    plots = {plot.name: plot for plot in report_plots(run).plots}
    plot = plots.get("peak_force") or plots.get("fan")
    if plot is None:
        return ""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "fan.png"
        draw_plot(path, plot, kind="png", dpi=150.0)
        data = base64.b64encode(path.read_bytes()).decode()
    return f'<img alt="{escape(plot.title)}" src="data:image/png;base64,{data}">'
