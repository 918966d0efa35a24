"""The passport of one damper: an A4 page that prints, and a JSON that is a baseline too."""

import base64
import json
import re
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from damperfit import __version__
from damperfit.queries.compared import baseline_text
from damperfit.reporting.drawing import draw_plot
from damperfit.reporting.figures import report_plots
from damperfit.reporting.plots import plot_in_units
from damperfit.reporting.records import checks_in
from damperfit.reporting.report import lead, tested_range
from damperfit.reporting.sheet import first_of, html_table, rows_in_units, sheet_in_units
from damperfit.reporting.tables import check_summary, force_sheets, parameter_sheet
from damperfit.results import Run
from damperfit.store import check_writable, write_text
from damperfit.tables.files import json_values
from damperfit.units.shown_units import ShownUnits

_PAGE = """<!doctype html>
<html lang=en><meta charset=utf-8>
<meta http-equiv=Content-Security-Policy
 content="default-src 'none'; style-src 'unsafe-inline'; img-src data:">
<title>{title}</title><style>
@page {{ size: A4; margin: 10mm }}
body {{ font: 7.5pt sans-serif; max-width: 190mm; margin: 0 auto; color: #111 }}
h1 {{ font-size: 13pt; margin: 0 0 1mm }} h2 {{ font-size: 8.5pt; margin: 2mm 0 .5mm }}
table {{ border-collapse: collapse; font-size: 6pt; width: 100% }}
td, th {{ border-bottom: .1mm solid #bbb; padding: .1mm .6mm; text-align: right }}
td {{ white-space: nowrap }}
th {{ font-weight: normal; background: #eee }} td:first-child, th:first-child {{ text-align: left }}
img {{ display: block; height: 62mm; margin: 1mm auto }} p {{ margin: .4mm 0 }}
.two {{ display: flex; gap: 4mm; align-items: flex-start }} .two > * {{ flex: 1 }}
.logs {{ columns: 2; font-size: 4.5pt }} code {{ font-size: 4.5pt }}
</style>
<body>
<h1>{title}</h1>
<p>{identity}</p>
<p>{lead}</p>
<p>{damper}</p>
<p>Tested: {tested}</p>
<div class=two>{forces}</div>
{picture}
{parameters}
{notes}
<h2>{checks}</h2>
{unmet}
<h2>Logs and their SHA-256</h2><p class=logs>{logs}</p>
<p>&plusmn; is a 95 % interval. damperfit {version}</p>
</body></html>
"""
_TITLES = ("damper", "serial", "customer", "operator", "date", "rig")
_MANY = 40  # logs that are listed by their hash on the page; the JSON has all


def write_passport(run: Run, folder: Path, units: ShownUnits) -> tuple[Path, Path]:
    """Write passport_NAME.html and .json into a folder; NAME is the serial number, or the run's."""
    name = run.name if run.place else "damper"
    title = run.identity.get("serial") or run.identity.get("damper") or name
    stem = f"passport_{re.sub(r'[^A-Za-z0-9._-]+', '_', Path(title).name) or 'damper'}"
    document: dict[str, Any] = json.loads(baseline_text(run))
    known = document["passport"] = {
        "identity": dict(run.identity),
        "lead": lead(run),
        "damper": run.damper.plain.sentence,
        "temperatures_degC": run.tested.temperatures,
        "checks": run.record.get("checks", []),
        "logs": {str(log.get("log")): log.get("sha256") for log in run.inputs},
        "clicks": run.forces.to_dict("records"),
    }
    page, record = folder / f"{stem}.html", folder / f"{stem}.json"
    check_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_text(record, json.dumps(json_values(document), indent=1, allow_nan=False) + "\n")
    whose = ((name, run.identity.get(name)) for name in _TITLES)
    checks = checks_in(run.record)
    unmet = (f"{check.name}: {check.reason}" for check in checks if not check.passed)
    hashes = [
        f"{escape(log)} <code>{escape(str(sha))}</code>" for log, sha in known["logs"].items()
    ]
    shown, more = first_of(hashes, _MANY, "in the JSON")
    forces = force_sheets(rows_in_units(run.rows("adjustment"), units))
    sheets = (
        *(sheet_in_units(sheet, units) for sheet in forces),
        parameter_sheet(run.rows("parameters"), run.quantities, units=units),
    )
    tables = [html_table(sheet) if sheet.rows else "" for sheet in sheets]
    text = _PAGE.format(
        title=escape(title),
        identity=" &middot; ".join(
            f"{name}: <b>{escape(text)}</b>" for name, text in whose if text
        ),
        lead=escape(known["lead"]),
        damper=escape(known["damper"]),
        tested=escape(tested_range(run.tested, units)),
        forces="\n".join(tables[:-1]),
        picture=_picture(run, units),
        parameters=tables[-1],
        notes="\n".join(f"<p>{escape(note)}</p>" for sheet in sheets for note in sheet.notes),
        checks=check_summary(checks),
        unmet="\n".join(f"<p>{escape(sentence)}</p>" for sentence in unmet),
        logs="<br>".join([*shown, *more]),
        version=__version__,
    )
    write_text(page, text)
    return page, record


def _picture(run: Run, units: ShownUnits) -> str:
    """Force against velocity of all settings."""
    plots = {plot.name: plot for plot in report_plots(run).plots}
    plot = plots.get("peak_force") or plots.get("fan")
    if plot is None:
        return ""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "fan.png"
        draw_plot(path, plot_in_units(plot, units), kind="png", dpi=150.0)
        data = base64.b64encode(path.read_bytes()).decode()
    return f'<img alt="{escape(plot.title)}" src="data:image/png;base64,{data}">'
