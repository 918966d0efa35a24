"""All texts of reports, from known numbers without a fit: ``python -m tests.texts`` writes them.

They stand in `tests/snapshots/texts.txt`, whose difference is read before a change is kept.
"""

import html
import math
import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

from matplotlib.text import Text

from damperfit.adjustment.force_at import Stage
from damperfit.checks import Check
from damperfit.comparison.circumstances import circumstances
from damperfit.comparison.comparing import ComparisonOptions, compare_runs
from damperfit.comparison.differences import compared as line_of
from damperfit.comparison.differences import difference_of, surely_different, verdict_of
from damperfit.comparison.measured import Reading, Topic
from damperfit.comparison.tolerance import Point, parse_tolerance, tolerated
from damperfit.damper.model import model_named
from damperfit.damper.mounting import FIT, Mounting
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.rivals import Linear
from damperfit.damper.valve_dampers import ThroughFlow
from damperfit.identification import Outcome
from damperfit.problem import Failure, Problem, failure_lines, short_listing
from damperfit.queries.compared import Comparison
from damperfit.queries.settings import notes_on_settings, notes_on_simulation
from damperfit.reporting.compared import (
    junit_report,
    tolerance_outcome,
    tolerance_sheet,
)
from damperfit.reporting.drawing import compose, fixed_style
from damperfit.reporting.figures import report_plots
from damperfit.reporting.inspection import finding_lines, inspection_sheet
from damperfit.reporting.page import html_report
from damperfit.reporting.records import to_record
from damperfit.reporting.report import markdown_report
from damperfit.reporting.sheet import text_table
from damperfit.reporting.tables import (
    check_lines,
    force_sheets,
    measured_force_sheet,
    parameter_sheet,
)
from damperfit.results import Run
from damperfit.tables.columns import PAPER_QUANTITIES
from damperfit.tables.files import typed_rows
from damperfit.tables.rows import campaign_rows
from damperfit.tested.setting import Setting
from tests.comparison.runs import fitted, measured
from tests.comparison.runs import run as run_of_tests
from tests.fakes import campaign, failed, fit
from tests.report_folder import EVIL, make_results

SNAPSHOT = Path(__file__).parent / "snapshots" / "texts.txt"
RECORD: dict[str, Any] = {"version": "1.2.3", "procedure": ["Procedure: paper."]}
CHECKS = (
    Check("no_cavitation", True, "no chamber reaches zero pressure"),
    Check("trend_monotone", False, "K_e falls from setting 3 to 4"),
    Check("temperature_in_window", None, "no log has a temperature"),
)


def _failure(log: str, setting: int | None, message: str) -> dict[str, Any]:
    return {"log": log, "path": log, "setting": setting, "kind": "LogError", "message": message}


# What was fitted, what else run.json tells, which settings were expected.
STATES: dict[str, tuple[Any, dict[str, Any], tuple[int, ...]]] = {
    "good": (
        campaign(fit(1), fit(2, mse=1.5), fit(3, logs=("a.csv", "b.csv"))),
        {
            "checks": [to_record(one) for one in CHECKS],
            "test": {"damper": "front left"},
            "configuration": {"damper": {"model": "purdy"}},
        },
        (),
    ),
    "poor": (
        campaign(fit(1), fit(2, mse=12.34)),
        {"gates_missed": ["setting 2: MSE 12.3 % is above 5 %"]},
        (),
    ),
    **{
        name: (campaign(fit(setting, outcome=Outcome(name), **how)), {}, ())
        for name, setting, how in (
            ("at_bound", 1, {"status": {"k_e": "at_bound"}, "mse": 2.5}),
            ("not_identifiable", 1, {"status": {"k_e": "not_identifiable"}}),
            ("cavitating", 19, {"f_0": -12.5, "status": {"f_0": "fitted"}}),
        )
    },
    "missing": (
        campaign(fit(1), fit(3)),
        {
            "failures": [_failure("setting_02.csv", 2, "empty file")],
            "warnings": ["there is no log of setting 2"],
            "gaps": [{"first": 2, "last": 2}],
        },
        (1, 2, 3),
    ),
    "nothing": (campaign(), {"failures": [_failure("a.csv", None, "a.csv: no data rows")]}, ()),
}


def run_of(done: Any, record: dict[str, Any], expected: tuple[int, ...] = ()) -> Run:
    """Return a run of these fits."""
    quantities = done.quantities or PAPER_QUANTITIES
    rows = campaign_rows(done, expected=expected)
    typed = {name: typed_rows(name, of, quantities) for name, of in rows.items()}
    return Run(RECORD | record, typed, quantities=quantities)


# Rows of the table "adjustment": the second setting is missed by the model in rebound at 0.3 m/s.
_ROW = """
setting speed_m_per_s stroke force_N change_N origin
1 0.05 rebound 200 - model
1 0.05 bump -200 - model
1 0.3 rebound 700 - model
1 0.3 bump -700 - model
2 0.05 rebound 300 100 model
2 0.05 bump -300 -100 model
2 0.3 rebound 801 100 measured
2 0.3 bump -800 -100 model
"""


def _force(heads: list[str], cells: list[str]) -> dict[str, Any]:
    row: dict[str, Any] = dict(zip(heads, cells, strict=True))
    row |= {"setting": int(row["setting"]), "speed_m_per_s": float(row["speed_m_per_s"])}
    force, is_measured = float(row["force_N"]), row["origin"] == "measured"
    reach = 0.392 if is_measured else 0.8
    row |= {"force_N": force, "force_ci_low_N": force - reach, "force_ci_high_N": force + reach}
    measured = force if is_measured else force + 1.0
    row |= {"measured_N": measured, "measured_se_N": 0.2, "difference_N": 1.0}
    change = None if row["change_N"] == "-" else float(row["change_N"])
    ends = ("change_N", 0.0), ("change_ci_low_N", -2.0), ("change_ci_high_N", 2.0)
    row |= {name: None if change is None else change + off for name, off in ends}
    return row if change is None else row | {"change_percent": 12.3}


_HEADS, *_ROWS = (line.split() for line in _ROW.strip().splitlines())
FORCES = [_force(_HEADS, cells) for cells in _ROWS]

_CLIPPED = {"name": "clipping", "severity": "warning", "sentence": "the force is clipped"}
LOGS = [
    {"name": f"run_{n}.csv", "setting": n, "n_samples_read": 5000, "sample_rate_Hz": 500.0}
    | {"cycles_used": 13, "cycles_found": 15, "frequency_Hz": 1.5, "amplitude_m": 0.032}
    | {"temperature_degC": 26.4, "verdict": "warnings" if n == 2 else "good"}
    | {
        "findings": [
            {"name": "noise", "severity": "note", "sentence": f"noise of {n}.5 N"},
            *([_CLIPPED] if n == 2 else []),
        ],
        "notes": ["26.4 degC on average"],
    }
    for n in (1, 2, 3)
]


# Hundreds of logs or parts are told by the code of their problem, each kind, all of few.
CAUSES = {
    "empty-file": "empty file (0 bytes)",
    "no-number": "line {n}: force is 'OVR{n}', expected a number",
    "no-column": "no column for force; there are 't{n}', 'x'",
}


def _failures(per_code: int) -> list[Failure]:
    problems = [
        Problem(code, CAUSES[code], subject=f"run_{n}.csv", values={"n": n})
        for i in range(per_code)
        for n, code in enumerate(CAUSES, start=i)
    ]
    return [Failure(one, "LogError", one.subject, f"runs/{one.subject}") for one in problems]


def _refused(n: int, code: str, severity: str = "refusal") -> dict[str, Any]:
    sentence = CAUSES[code].format(n=n)
    finding = {"name": "unreadable", "severity": severity, "sentence": sentence, "value": n}
    verdict = "refused" if severity == "refusal" else "good"
    return {"name": f"run_{n}.csv", "verdict": verdict, "code": code, "findings": [finding]}


def many() -> dict[str, Any]:
    """Return the lines on many logs, by what is told."""
    parts = (
        failed(f"a.dat part {k}", "a.dat", 3, "LogError", f"a.dat part {k}: {k} samples", "short")
        for k in range(1, 301)
    )
    refused = [_refused(100 * k + i, code) for i in range(50) for k, code in enumerate(CAUSES)]
    return {
        "failures": failure_lines(_failures(3)),
        "many failures": failure_lines(_failures(100)),
        "parts of a file": failure_lines(parts),
        "many warnings": short_listing([*map(str, range(21)), "0"]),
        "refused logs": finding_lines(refused),
        "refused logs of a damper": finding_lines([_refused(k, "no-number") for k in range(1, 22)]),
        "a note of many": finding_lines([_refused(k, "no-number", "note") for k in range(300)]),
    }


_X = {"log": "x.csv", "sha256": "ab", "setting": 1}
_LEFT = {"inputs": [_X | {"reversed": ["force"]}]}


def _configured(section: str, **keys: Any) -> dict[str, Any]:
    return {"configuration": {section: keys}}


_OWN, *_REST = PURDY_DAMPER.quantities
# What two runs have that is told where it differs; of none of these anything else is told.
DIFFERING: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "serials": ({"test": {"serial": "7"}}, {"test": {"serial": "8"}}),
    "filters": tuple(_configured("conditioning", filter_corner=f) for f in ("30Hz", "60Hz")),
    "held": tuple(_configured("identification", fix=fix) for fix in ({}, {"f_f": "50N"})),
    "held as text": tuple(_configured("identification", fix={"f_f": f}) for f in (50, 50.0)),
    "held elsewhere": tuple(_configured("identification", fix={"f_f": f}) for f in (50, 51)),
    "versions": ({"version": "1.0"}, {"version": "1.1"}),
    "same logs": ({"inputs": [_X]}, {"inputs": [_X | {"log": "y.csv"}]}),
    "both reversed": (
        {"inputs": [_X | {"reversed": []}]},
        {"inputs": [_X | {"reversed": ["displacement", "force"]}]},
    ),
    "force reversed": (_LEFT, {"inputs": [_X | {"reversed": []}]}),
    "other logs reversed": (_LEFT, {"inputs": [_X | {"sha256": "cd", "reversed": []}]}),
    "an older run": (_LEFT, {"inputs": [_X]}),
    "gas": ({}, {"damper": replace(PURDY_DAMPER, gas_pressure=5.6e5)}),
    "models": ({}, {"damper": model_named("twin_tube")()}),
    "units": ({}, {"quantities": (replace(_OWN, unit="furlong"), *_REST)}),
}
NONE = [SimpleNamespace(sentence="nothing")]


def of_the_rig() -> list[str]:
    """Return what is said of forces that the rig is in: what `export` writes has the damper's."""
    told, late, soft = [], {"lag": FIT}, {"series_stiffness": FIT}
    parts = ({}, late, {"lag": 0.008}, soft | {"play": FIT}, soft | late)
    for mounting, offset in ((parts[0], 0.0), (parts[0], 12.0), *((one, -3.4) for one in parts)):
        damper = ThroughFlow(mounting=Mounting(**({"series_stiffness": "none"} | mounting)))
        numbers = {one.name: one.plausible[0] for one in damper.quantities}
        values = damper.values(numbers | {"f_0": offset})
        told += [f"{mounting}, {offset:g} N", *notes_on_simulation(damper, values)]
        told += notes_on_settings(damper, [Stage(Setting.of(1), values)])
    linear = Linear()  # its offset holds the gas force: it is not the rig's alone
    values = linear.values({"c": 1e3, "f_0": -130.0})
    return [*told, "no gas", *notes_on_simulation(linear, values)]


def compared() -> dict[str, Any]:
    """Return what is told of measured runs side by side, and of each kind of line and point."""
    first = run_of_tests(measured(1, noise=1.0), measured(2, noise=1.0), name="before")
    second = run_of_tests(measured(1, factor=1.1, noise=1.0, seed=9), name=EVIL)
    comparison = compare_runs(first, second, ComparisonOptions(is_measured=True))
    tolerated_by = "5%"
    met = tolerated(comparison, parse_tolerance(tolerated_by))
    hysteresis = Topic("figure", "hysteresis_rebound", "hysteresis, rebound", "N", Setting.of(3))
    force = Topic("force", "force", "force", "N", Setting.of(3), 0.26, "bump")
    figure = hysteresis._replace(name="hysteresis", label="hysteresis")
    told = [
        *((force, -800.0, -1000.0, second) for second in (-1080.0, -960.0, -997.0, -1003.0)),
        *((hysteresis, 600.0, -57.0, -54.0), (hysteresis, 600.0, 40.0, 48.0)),
        (figure, math.nan, 0.0, -9.0),
    ]
    lines = [line_of(one, *(Reading(n, 1.0, scale=s) for n in pair)) for one, s, *pair in told]
    lines = surely_different(lines)
    pairs = ((name, fitted(1, **a), fitted(1, name="b", **b)) for name, (a, b) in DIFFERING.items())
    differing = [
        f"{name}: {one.sentence}" for name, *both in pairs for one in circumstances(*both) or NONE
    ]
    place = ("b\x1b", "3", 0.26, "rebound")
    points = [Point(*place, one, 90.0, 110.0, 1.0) for one in (100.0, 112.0, 109.5, 110.0)]
    points.append(Point(*place, math.nan, 90.0, 110.0, 1.0, reason="not tested"))
    return {
        "comparison.md": Comparison((comparison,), (EVIL,), (), met, tolerated_by).markdown,
        "circumstances": differing,
        "differences": [f"{one.subject.place()}: {verdict_of(one)}" for one in lines],
        "by how much": [difference_of(one) for one in lines],
        "tolerance": [*(one.words for one in points), tolerance_outcome(points)],
        "tolerance table": text_table(tolerance_sheet(points)),
        "JUnit": junit_report(points, source="<5%>").decode(),
    }


def page_words(page: str) -> str:
    """Return what a page says, a line a row, item or heading."""
    body = page[page.index("</style>") : page.index('<script type="application/json"')]
    text = re.sub(r"</(tr|p|li|h\d|summary|figcaption|dd)>", "\n", body)
    text = re.sub(r"<[^>]+>", "", re.sub(r"</t[dh]>", " | ", text))
    lines = (" ".join(html.unescape(line).split()) for line in text.splitlines())
    return "\n".join(line for line in lines if line)


def _figure_words(shown: Any) -> str:
    lines = []
    for plot in shown.plots:
        if plot.name.startswith("setting_") and not plot.name.startswith("setting_03"):
            continue
        with fixed_style():
            figure = compose(plot, dpi=60)
            figure.draw_without_rendering()
            words = [one.get_text() for one in figure.findobj(Text) if one.get_visible()]
        said = [word for word in words if word and not re.fullmatch(r"[−\d.e+-]+", word)]
        lines += [plot.name, *(f"    {word}" for word in (*said, plot.caption))]
    return "\n".join(lines)


def texts() -> dict[str, str]:
    """Return every text by its name."""
    told = {}
    for state, (done, record, expected) in STATES.items():
        run = run_of(done, record, expected)
        told[f"report.md, {state}"] = markdown_report(run).rstrip("\n")
        if rows := run.rows("parameters"):
            told[f"terminal, {state}"] = text_table(parameter_sheet(rows))
    told["terminal, checks"] = "\n".join(check_lines(CHECKS))
    for name, sheets in (
        ("by speed", force_sheets(FORCES)),
        ("measured", [measured_force_sheet(FORCES)]),
    ):
        told[f"terminal, forces {name}"] = "\n\n".join(map(text_table, sheets))
    told["terminal, inspect"] = "\n".join(
        [text_table(inspection_sheet(LOGS)), *finding_lines(LOGS, has_notes=True)]
    )
    told |= {f"of many: {name}": "\n".join(lines).rstrip("\n") for name, lines in many().items()}
    told["what the rig adds"] = "\n".join(map(str, of_the_rig()))
    for name, lines in compared().items():
        text = lines if isinstance(lines, str) else "\n".join(lines)
        told[f"compared: {name}"] = text.rstrip("\n")
    with TemporaryDirectory() as folder:
        shown = report_plots(Run.load(make_results(Path(folder))))
        told["report.html"] = page_words(html_report(shown, title="results"))
        told["figures"] = _figure_words(shown)
    return told


def written(told: dict[str, str]) -> str:
    """Return the texts as the file that holds them."""
    return "".join(f"===== {name}\n{text}\n\n" for name, text in told.items())


if __name__ == "__main__":
    SNAPSHOT.parent.mkdir(exist_ok=True)
    SNAPSHOT.write_text(written(texts()), encoding="utf-8")
