"""The passport of one damper: an A4 page that prints, and a JSON that is a baseline too."""

import base64
import json
import re
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from damperfit import __version__
from damperfit.queries.compared import baseline_text, read_run
from damperfit.reporting.drawing import draw_plot
from damperfit.reporting.figures import report_plots
from damperfit.reporting.report import lead
from damperfit.reporting.sheet import html_table, rows_in_units, sheet_in_units
from damperfit.reporting.tables import force_sheets, parameter_sheet
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
<p>{damper}; {tested}</p>
<div class=two>{forces}</div>
{picture}
{parameters}
<h2>Checks: {passed} of {checks} passed</h2>
{failed}
<h2>Logs and their SHA-256</h2><p class=logs>{logs}</p>
<p>&plusmn; is a 95 % interval. damperfit {version}</p>
</body></html>
"""
_TITLES = ("damper", "serial", "customer", "operator", "date", "rig")
_MANY = 40  # logs that are listed by their hash on the page; the JSON has all


def write_passport(run: Run, folder: Path, units: ShownUnits) -> tuple[Path, Path]:
    """Write passport_NAME.html and .json into a folder; NAME is the serial number, or the run's."""
    title = run.identity.get("serial") or run.identity.get("damper") or run.name
    stem = f"passport_{re.sub(r'[^A-Za-z0-9._-]+', '_', Path(title).name) or 'damper'}"
    document: dict[str, Any] = json.loads(baseline_text(read_run(run.place or run.folder)))
    known = document["passport"] = {
        "identity": dict(run.identity),
        "lead": lead(run),
        "damper": run.damper.plain.sentence,
        "temperatures_degC": run.tested.temperatures,
        "checks": run.record.get("checks", []),
        "logs": {str(one.get("log")): one.get("sha256") for one in run.inputs},
        "clicks": run.forces.to_dict("records"),
    }
    page, record = folder / f"{stem}.html", folder / f"{stem}.json"
    check_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_text(record, json.dumps(json_values(document), indent=1, allow_nan=False) + "\n")
    whose = ((name, run.identity.get(name)) for name in _TITLES)
    passed = [bool(one["passed"]) for one in known["checks"]]
    failed = (f"{one['name']}: {one['reason']}" for one in known["checks"] if not one["passed"])
    hashes = [
        f"{escape(log)} <code>{escape(str(sha))}</code>" for log, sha in known["logs"].items()
    ]
    more = [f"and {len(hashes) - _MANY} more, in the JSON"] if len(hashes) > _MANY else []
    warm = known["temperatures_degC"]
    tables = [
        html_table(sheet_in_units(sheet, units)) if sheet.rows else ""
        for sheet in (
            *force_sheets(rows_in_units(run.rows("adjustment"), units)),
            parameter_sheet(run.rows("parameters"), run.quantities),
        )
    ]
    text = _PAGE.format(
        title=escape(title),
        identity=" &middot; ".join(f"{name}: <b>{escape(one)}</b>" for name, one in whose if one),
        lead=escape(known["lead"]),
        damper=escape(known["damper"]),
        tested=(
            "tested at {:.0f} to {:.0f} &deg;C".format(*warm)
            if warm
            else "temperature of the tests not known"
        ),
        forces="\n".join(tables[:-1]),
        picture=_picture(run),
        parameters=tables[-1],
        passed=sum(passed),
        checks=len(passed),
        failed="\n".join(f"<p>{escape(sentence)}</p>" for sentence in failed),
        logs="<br>".join([*hashes[:_MANY], *more]),
        version=__version__,
    )
    write_text(page, text)
    return page, record


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
