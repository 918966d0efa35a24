"""What commands and functions may be asked for, each told once: a keyword here is an option there.

A function of `damperfit.api` names its keywords in its signature; what a keyword takes and what it
is for stand here, or with the key of the configuration that it sets
(`damperfit.configuration.sections`). The command of the same name makes its options of both. An
entry ``command.keyword`` goes before that of the keyword alone.
"""

from __future__ import annotations

import re
from functools import cache
from inspect import signature
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.configuration.sections import SECTIONS, Entry

if TYPE_CHECKING:
    from collections.abc import Callable


_OPTION = re.compile(r"--([a-z][a-z-]*)")
# Options that say how a command talks, and keywords that take objects of Python.
PRESENTATION = (
    *("json", "quiet", "debug", "version", "log_file", "github_summary", "list"),
    *("color", "no_progress", "verbose"),
)
_OF_PYTHON = {
    "damper": "The damper, or keys of [damper]; the paper's where neither it nor `config` says it.",
    "watch": "Who looks on: progress, and the wish to stop.",
    "stop": "Ends it when it is set; Ctrl-C does so too.",
    "on_law": "Called with the name of each law that was tried.",
    "inspect.units": "Units of columns that do not say theirs.",
}
# In the order of the help; what stands in none stands last, under "Options".
PANELS = ("Logs", "Damper", "Rig", "Fit", "Motion", "Trust", "Gates", "Work", "Output", "Options")


class Keyword(NamedTuple):
    """One keyword, and the option that it is on the command line."""

    # text, texts, names, quantities (names in lower case), values (of quantities, NAME=VALUE),
    # pairs (KEY=VALUE), number, count, workers, path, paths, results, arguments or flag
    kind: str
    metavar: str
    help: str
    panel: str = "Options"  # where the help shows it
    key: str = ""  # of the configuration, as in "rig.skew"; empty: it sets none
    names: tuple[str, ...] = ()  # other spellings of the option


# What sets no key, by panel: kind, word for the value, help, other spellings.
# fmt: off
_TABLE: dict[str, dict[str, tuple[Any, ...]]] = {
    "Options": {
        "logs": ("arguments", "LOGS...",
            "Log files, patterns such as 'runs/*.csv', folders, @list.txt."),
        "fleet.logs": ("arguments", "[LOGS...]",
            "Folders, files, patterns, or addresses such as s3://bucket/runs."),
        "init.logs": ("arguments", "[LOGS...]",
            "Logs of the damper: units, setting and signs are guessed."),
        "debug": ("flag", "", "Show the traceback of an error."),
        "version": ("flag", "", "Print the version and exit.", "-V"),
        "results": ("argument", "RESULTS", "Folder that identify wrote, or fleet/serial-D003."),
        "advise.results": ("argument", "RESULTS", "Folder that identify wrote."),
        "passport.results": ("argument", "RESULTS", "Folder that identify wrote."),
        "settings.results": ("arguments", "RESULTS",
            "Folder that identify wrote, or files of measured curves.  [default: results]"),
        "runs": ("arguments", "A B...",
            ("Results folders, or folders of several; A is the reference. With --measured also raw "
            "logs: a folder, a quoted pattern or @list.txt of them is one run.")),
        "watch.folder": ("argument", "DIR", "Folder that the rig writes into."),
        "watch.reference": ("results", "RESULTS", "What forces are compared with."),
        "folder": ("argument", "DIR", "Folder for the logs."),
        "for_": ("text", "NAME|force@SPEED|law",
            "What is to be known better: k_e, force@0.05m/s (minus: compression), law."),
        "advise.setting": ("text", "N", "Plan for this setting alone."),
        "car": ("table", "FILE.toml", "[car]: masses, spring, tyre, motion ratio, road, speed."),
        "ride.stroke": ("path", "LOG",
            "Time and damper displacement of a car, in place of the road."),
        "ride.setting": ("text", "N", "This setting alone."),
        "cd": ("number", "C_D", "Discharge coefficient of the orifices."),
        "cd_spread": ("number", "N", "How far it may be off; it widens the intervals."),
        "seat": ("text", "LENGTH", "Diameter of the blow-off's seat, as in 8mm."),
        "reference": ("results", "RESULTS", "Earlier run of the damper: what has worn since?"),
        "topic": ("argument", "TOPIC", "A page of the manual, or a command."),
    },
    "Logs": {
        "setting": ("text", "N", "Setting of logs that do not give one."),
        "rig": ("pairs", "KEY=VALUE",
            "A key of [rig], such as units.force=kN; may be given several times."),
        "measured": ("flag", "",
            "Compare measured curves only; takes folders of raw logs, logs and curve files."),
    },
    "Damper": {
        "simulate.setting": ("text", "N", "Setting whose parameters are used."),
        "sweep.setting": ("text", "N", "Setting whose parameters are used."),
        "config": ("path", "FILE.toml",
            "Damper, rig and identification.  [default: the paper's damper and test]"),
        "set": ("values", "NAME=VALUE",
            ("Replace a parameter; may be given several times. With all five, --setting is not "
            "needed.")),
        "init.set": ("pairs", "KEY=VALUE",
            "A key of [damper], as in rod_diameter=12mm; may be given several times."),
        "layout": ("text", "NAME",
            "Layout of the damper, if known: twin_tube, monotube, through_flow."),
        "parameters": ("results", "FILE",
            ("Parameters table (.parquet, .csv) or results folder.  [default: results, if it is "
            "there, else the shipped reference set]")),
        "samples.parameters": ("results", "FILE",
            ("True values, with damper and motion: parameters table (.parquet, .csv) or results "
            "folder.  [default: the shipped reference set]")),
        "settings": ("text", "LIST", "Settings to make, as in 1,5,10-12."),
    },
    "Rig": {
        "force_noise": ("text", "FORCE", "Sensor noise of the force, rms."),
        "displacement_noise": ("text", "LENGTH", "Sensor noise of the displacement, rms."),
        "rig_filter": ("text", "FREQ", "Corner of a filter in the rig; 0: no filter."),
        "seed": ("count", "N", "Of the noise; same seed, same logs."),
        "max_stroke": ("text", "LENGTH",
            "Largest amplitude of the rig.  [default: rig.max_stroke, as tested]"),
        "max_speed": ("text", "SPEED",
            "Highest peak speed.  [default: rig.max_speed, twice what was tested]"),
        "max_force": ("text", "FORCE", "Highest force.  [default: rig.max_force, no limit]"),
        "max_frequency": ("text", "FREQ",
            "Highest frequency.  [default: rig.max_frequency, 10 Hz]"),
        "max_heat": ("text", "POWER",
            "Mean power that the test turns into heat.  [default: rig.max_heat, no limit]"),
        "minutes": ("number", "N",
            "Longest test of one setting, min.  [default: rig.minutes, 2]"),
    },
    "Fit": {
        "rivals": ("flag", "",
            "Where the logs choose the model, also rank fourteen from the literature."),
        "covariate": ("text", "temperature",
            "Let viscous resistances follow the temperature of each log; one beta for all."),
    },
    "Motion": {
        "samples.cycles": ("number", "N", "Cycles in a log."),
        "samples.sample_rate": ("text", "RATE", "Samples per second, as in 1000Hz."),
        "settings.velocity": ("text", "SPEED", "At this speed, as in 0.2m/s; minus: compression."),
        "valves.velocity": ("text", "SPEED", "At this speed, as in 0.2m/s; minus: compression."),
        "valves.force": ("text", "FORCE", "Which orifice or preload gives it? As in 900N."),
        "compare.velocity": ("texts", "SPEED",
            "Speeds to compare at.  [default: the named test speeds]"),
        "stroke": ("text", "NAME", "rebound or compression, instead of a sign."),
        "force": ("text", "FORCE", "Which setting gives it? As in 900N; minus: compression."),
        "vary": ("texts", "NAME=F1,F2",
            "Scale by these factors: r_m1 r_m2 r_m3 k_e f_f f_0 p_0 gamma amplitude frequency."),
        "paper": ("flag", "",
            "Figures 4 to 9 of the paper, at setting 10 unless --setting says otherwise."),
        "displacement": ("path", "LOG", "Drive with the displacement of a log, not a wave."),
        "temperature": ("text", "TEMP",
            "Of the oil, as in 40degC; after identify --covariate temperature."),
    },
    "Output": {
        "simulate.out": ("path", "FILE", "Write the signals: .csv or .parquet."),
        "sweep.out": ("path", "DIR", "Folder for table and figures.  [default: sweep]"),
        "compare.out": ("path", "DIR", "Write page, Markdown, JSON and tables."),
        "export.out": ("path", "PATH",
            "A file if it has a suffix, else a folder.  [default: export in the results folder]"),
        "report.out": ("path", "DIR", "Where to write.  [default: the results folder]"),
        "passport.out": ("path", "DIR", "Where to write.  [default: the working folder]"),
        "watch.out": ("path", "DIR",
            "Folder of results and page of all logs so far.  [default: nothing is written]"),
        "fleet.out": ("path", "DIR", "Folder of the fleet's parts."),
        "init.out": ("path", "FILE.toml",
            "Where to write; - prints it.  [default: my_damper.toml]"),
        "overwrite": ("flag", "", "Replace files of another origin that are in the way."),
        "init.overwrite": ("flag", "", "Replace the file if it is there."),
        "report": ("flag", "", "Also write report.html, as damperfit report does."),
        "fleet.report": ("flag", "",
            "Also write the tables and one page of the fleet: _fleet/fleet.html."),
        "figures": ("text", "KIND", "Write the figures as files: png, svg or pdf.", "--plots"),
        "plot": ("path", "FILE", "Draw the loops: .png, .svg or .pdf."),
        "to": ("text", "TARGET", "What to write; --list shows them."),
        "schema": ("flag", "",
            "Print the JSON schema of configuration files, for an editor, and exit."),
        "list": ("flag", "", "Show the targets with file, units and sign."),
        "github_summary": ("flag", "", "Append the report to the summary of the job."),
        "save": ("path", "FILE.json", "Keep A as a baseline."),
        "collect": ("flag", "", "Then write one table of all parts: _fleet/fleet.parquet, .csv."),
        "decimal": ("text", "MARK", "Decimal mark in CSV files: a point or a comma."),
        "extend": ("text", "SPEED", "Extend tables beyond the tested speed; marked as untested."),
        "json": ("flag", "", "Print one JSON document on stdout and nothing else there."),
        "quiet": ("flag", "", "No progress bar, no remarks; errors are still shown.", "-q"),
        "verbose": ("flag", "",
            "Show each step on stderr: logs read, fits, times, files written.", "-v"),
        "log_file": ("path", "FILE",
            "Append every message and step to FILE, one line each, with its time."),
        "color": ("text", "WHEN",
            "Colours on stdout: auto, always or never.  [default: auto, on a terminal]"),
        "no_progress": ("flag", "", "No progress bar."),
    },
    "Trust": {
        "repeats": ("paths", "RESULTS",
            "Repeat run of A; the scatter of the repeats is the yardstick."),
    },
    "Gates": {
        "export.check": ("flag", "",
            "Run what was written against the logs of the run; show the error."),
        "tolerance": ("text", "5%|20N|FILE",
            ("Band around the reference (of a fleet: the median), or a table of bands; missed: "
            "code 4.")),
        "junit": ("path", "FILE.xml", "Write the points of --tolerance as JUnit XML."),
    },
    "Work": {
        "jobs": ("workers", "N", "Workers, 1 or more.  [default: the cores available]"),
        "scheduler": ("text", "ADDRESS", "Work on a Dask cluster, as in tcp://10.0.0.1:8786."),
        "part": ("text", "I/N", "Only part I of N, as in a job array: 3/100."),
    },
}
# fmt: on
# Of a key of the configuration, by its default.
_KINDS = {bool: "flag", int: "count", float: "number", list: "texts", dict: "values"}


def _of_key(section: str, name: str, entry: Entry) -> Keyword:
    """Return the keyword that sets a key of the configuration."""
    kind = entry.kind or _KINDS.get(type(entry.default), "text")
    text = entry.about[:1].upper() + entry.about[1:]
    if kind in {"texts", "values"} and "|" not in entry.option:
        text += "; may be given several times"
    is_telling = entry.default and not isinstance(entry.default, list | dict)
    shown = f"{entry.default:g}" if isinstance(entry.default, float) else entry.default
    default = f"  [default: {shown}]" if is_telling and "default" not in text else ""
    return Keyword(kind, entry.option, f"{text}.{default}", entry.panel, f"{section}.{name}")


@cache
def _keywords() -> dict[str, Keyword]:
    known = {
        entry.keyword or name: _of_key(section, name, entry)
        for section, kind in SECTIONS.items()
        for name, entry in kind.entries().items()
        if entry.panel
    }
    for panel, rows in _TABLE.items():
        known |= {
            name: Keyword(row[0], row[1], row[2], panel, "", row[3:]) for name, row in rows.items()
        }
    return known


def keyword_of(command: str, name: str) -> Keyword | None:
    """Return what a keyword of a command is; None of what takes objects of Python alone.

    >>> keyword_of("identify", "skew").key
    'rig.skew'
    """
    if {name, f"{command}.{name}"} & {*_OF_PYTHON}:
        return None
    return _keywords().get(f"{command}.{name}") or _keywords().get(name)


def option_of(name: str) -> str:
    """Return the option that a keyword is on the command line."""
    return f"--{name.rstrip('_').replace('_', '-')}"


def with_keywords(function: Callable[..., Any]) -> str:
    """Return the docstring of a function with the keywords that it does not tell itself."""
    text, command = function.__doc__ or "", function.__name__
    told = {
        name.strip().lstrip("*")
        for line in text.splitlines()
        if line[:4].isspace() and line[4:5].strip()
        for name in line.partition(" : ")[0].split(",")
    }
    lines = []
    for name, parameter in signature(function).parameters.items():
        keyword = keyword_of(command, name)
        about = _OF_PYTHON.get(name) or _OF_PYTHON.get(f"{command}.{name}")
        if keyword is not None:
            about = _OPTION.sub(lambda option: option[1].replace("-", "_") + "=", keyword.help)
        if about is not None and name not in told:
            kind = str(parameter.annotation).removesuffix(" | None")
            kind = kind if kind != "object" else "path, pattern, list of such, or labelled frames"
            lines += [f"    {name} : {kind}", f"        {about}"]
    title = "Other Parameters" if "    Parameters\n" in text else "Parameters"
    heading = ["", f"    {title}", f"    {'-' * len(title)}"]
    return "\n".join([text.rstrip(), *heading, *lines, ""]) if lines else text
