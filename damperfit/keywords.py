"""What commands and functions may be asked for, each told once: a keyword here is an option there.

A function of `damperfit.api` names its keywords in its signature; what a keyword takes, what it is
for and which key of the configuration it sets stand here. The command of the same name makes its
options of both. An entry ``command.keyword`` goes before that of the keyword alone.
"""

from __future__ import annotations

from importlib import import_module
from inspect import signature
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = [
    "PANELS",
    "PRESENTATION",
    "PYTHON_ONLY",
    "FunctionPackage",
    "Keyword",
    "keyword_of",
    "option_of",
    "with_keywords",
]

# Options that say how a command talks, and keywords that take objects of Python.
PRESENTATION = ("json", "quiet", "debug", "version", "log_file", "github_summary", "list")
PYTHON_ONLY = ("damper", "watch", "on_law", "inspect.units")


class Keyword(NamedTuple):
    """One keyword, and the option that it is on the command line.

    Attributes
    ----------
    kind : str
        text, texts, names, quantities (names in lower case), values (of quantities, NAME=VALUE),
        pairs (KEY=VALUE), number, count, path, paths or flag.
    metavar, help : str
        As the help shows them.
    panel : str
        Where the help shows it.
    key : str
        Of the configuration, as in "rig.skew"; empty: it sets none.
    names : tuple of str
        Other spellings of the option.
    """

    kind: str
    metavar: str
    help: str
    panel: str = "Options"
    key: str = ""
    names: tuple[str, ...] = ()


_FLAG = ""
_LOGS = Keyword(
    "arguments", "LOGS...", "Log files, patterns such as 'runs/*.csv', folders, @list.txt."
)
_RESULTS = Keyword("argument", "RESULTS", "Folder that identify wrote, or fleet/serial=D003.")
_REPLACE = "Replace files of another origin that are in the way."

_KEYWORDS: dict[str, Keyword] = {
    # Logs
    "logs": _LOGS,
    "fleet.logs": Keyword(
        "arguments",
        "[LOGS...]",
        "Folders, files, patterns, or addresses such as s3://bucket/runs.",
    ),
    "init.logs": Keyword(
        "arguments", "[LOGS...]", "Logs of the damper: units, setting and signs are guessed."
    ),
    "setting": Keyword("text", "N", "Setting of logs that do not give one.", "Logs"),
    "simulate.setting": Keyword("text", "N", "Setting whose parameters are used.", "Damper"),
    "sweep.setting": Keyword("text", "N", "Setting whose parameters are used.", "Damper"),
    "tests": Keyword(
        "path",
        "FILE",
        "Table of tests: file, adjusters, damper.  [default: tests.csv beside the logs]",
        "Logs",
        "test.table",
    ),
    "rig": Keyword(
        "pairs",
        "KEY=VALUE",
        "A key of [rig], such as units.force=kN; may be given several times.",
        "Logs",
    ),
    "rig_profile": Keyword(
        "text", "NAME", "Profile of the rig for every log.", "Logs", "rig.profile"
    ),
    "skew": Keyword(
        "text",
        "TIME|auto",
        "Delay of the force, as in 2ms, or auto to estimate it.  [default: 0s]",
        "Logs",
        "rig.skew",
    ),
    "allow_truncated": Keyword(
        "flag",
        _FLAG,
        "Keep the part of a truncated TDMS log that all channels have.",
        "Logs",
        "rig.allow_truncated",
    ),
    "measured": Keyword(
        "flag",
        _FLAG,
        "Compare measured curves only; takes folders of raw logs, logs and curve files.",
        "Logs",
    ),
    # Damper
    "config": Keyword(
        "path",
        "FILE.toml",
        "Damper, rig and identification.  [default: the paper's damper and test]",
        "Damper",
    ),
    "model": Keyword(
        "text",
        "NAME",
        "Model of the damper; with identify also auto, the one that the logs support.  "
        "[default: purdy]",
        "Damper",
        "damper.model",
    ),
    "samples.model": Keyword(
        "text", "NAME", "Model of the damper.  [default: purdy]", "Damper", "damper.model"
    ),
    "init.model": Keyword(
        "text", "NAME", "purdy, twin_tube, monotube, through_flow ...  [default: purdy]", "Damper"
    ),
    "set": Keyword(
        "values",
        "NAME=VALUE",
        "Replace a parameter; may be given several times. With all five, --setting is not needed.",
        "Damper",
    ),
    "init.set": Keyword(
        "pairs",
        "KEY=VALUE",
        "A key of [damper], as in rod_diameter=12mm; may be given several times.",
        "Damper",
    ),
    "layout": Keyword(
        "text",
        "NAME",
        "Layout of the damper, if known: twin_tube, monotube, through_flow.",
        "Damper",
    ),
    "parameters": Keyword(
        "results",
        "FILE",
        "Parameters table (.parquet, .csv) or results folder.  [default: results, if it is there, "
        "else the shipped reference set]",
        "Damper",
    ),
    "samples.parameters": Keyword(
        "results",
        "FILE",
        "True values, with damper and motion: parameters table (.parquet, .csv) or results "
        "folder.  [default: the shipped reference set]",
        "Damper",
    ),
    "settings": Keyword("text", "LIST", "Settings to make, as in 1,5,10-12.", "Damper"),
    # Rig
    "force_noise": Keyword("text", "FORCE", "Sensor noise of the force, rms.", "Rig"),
    "displacement_noise": Keyword(
        "text", "LENGTH", "Sensor noise of the displacement, rms.", "Rig"
    ),
    "rig_filter": Keyword("text", "FREQ", "Corner of a filter in the rig; 0: no filter.", "Rig"),
    "seed": Keyword("count", "N", "Of the noise; same seed, same logs.", "Rig"),
    # Fit
    "free": Keyword(
        "quantities",
        "NAME,NAME",
        "Parameters to fit; in the paper's model r_m1 r_m2 r_m3 k_e f_f f_0.  [default: those of "
        "the procedure]",
        "Fit",
        "identification.free",
    ),
    "fix": Keyword(
        "values",
        "NAME=VALUE",
        "Hold a parameter at a value; may be given several times.",
        "Fit",
        "identification.fix",
    ),
    "procedure": Keyword(
        "text",
        "NAME",
        "How to fit: paper, joint, plain.  [default: paper; of other models plain]",
        "Fit",
        "identification.procedure",
    ),
    "share": Keyword(
        "quantities",
        "NAME,NAME",
        "Parameters shared by all settings in a joint fit.",
        "Fit",
        "identification.share",
    ),
    "bulk_modulus": Keyword(
        "text",
        "NAME",
        "K_e: free, or appendix1, from one gas content.  [default: free]",
        "Fit",
        "identification.bulk_modulus",
    ),
    "start": Keyword(
        "texts",
        "FILE|NAME=VALUE",
        "Where the fits start: parameters of an earlier run, or values, as in f_f=30,k_e=2e9.",
        "Fit",
    ),
    "starts": Keyword(
        "count",
        "N",
        "Fit each setting from N starts.  [default: 1]",
        "Fit",
        "identification.starts",
    ),
    "rivals": Keyword(
        "flag",
        _FLAG,
        "Where the logs choose the model, also rank fourteen from the literature.",
        "Fit",
    ),
    "covariate": Keyword(
        "text",
        "temperature",
        "Let viscous resistances follow the temperature of each log; one beta for all.",
        "Fit",
    ),
    # Motion
    "wave": Keyword(
        "text", "NAME", "sine or triangle.  [default: sine]", "Motion", "simulation.wave"
    ),
    "amplitude": Keyword(
        "text",
        "LENGTH",
        "Amplitude of the simulated motion, as in 32mm.  [default: that of the test]",
        "Motion",
        "rig.amplitude",
    ),
    "frequency": Keyword(
        "text",
        "FREQ",
        "Frequency of the simulated motion, as in 1.5Hz.  [default: that of the test]",
        "Motion",
        "rig.frequency",
    ),
    "cycles": Keyword(
        "number",
        "N",
        "Number of cycles, 1 or more.  [default: 4]",
        "Motion",
        "simulation.cycles",
    ),
    "samples.cycles": Keyword("number", "N", "Cycles in a log.", "Motion"),
    "sample_rate": Keyword(
        "text",
        "RATE",
        "As in 1000Hz; a bare number is Hz.  [default: 1000Hz]",
        "Motion",
        "simulation.sample_rate",
    ),
    "samples.sample_rate": Keyword(
        "text", "RATE", "Samples per second, as in 1000Hz.", "Motion"
    ),
    "max_steps": Keyword(
        "workers",
        "N",
        "Limit on samples and integrator steps, 1 or more.  [default: 5000000]",
        "Motion",
        "simulation.max_steps",
    ),
    "velocity": Keyword(
        "text", "SPEED", "At this speed, as in 0.2m/s; minus: bump.", "Motion"
    ),
    "identify.velocity": Keyword(
        "texts",
        "SPEED",
        "Show forces at these speeds, as in 0.05m/s.  [default: the named test speeds]",
        "Output",
        "output.speeds",
    ),
    "compare.velocity": Keyword(
        "texts", "SPEED", "Speeds to compare at.  [default: the named test speeds]", "Motion"
    ),
    "stroke": Keyword("text", "NAME", "rebound or bump, instead of a sign.", "Motion"),
    "force": Keyword(
        "text", "FORCE", "Which setting gives it? As in 900N; minus: bump.", "Motion"
    ),
    "vary": Keyword(
        "texts",
        "NAME=F1,F2",
        "Scale by these factors: r_m1 r_m2 r_m3 k_e f_f f_0 p_0 gamma amplitude frequency.",
        "Motion",
    ),
    "paper": Keyword(
        "flag",
        _FLAG,
        "Figures 4 to 9 of the paper, at setting 10 unless --setting says otherwise.",
        "Motion",
    ),
    "displacement": Keyword(
        "path", "LOG", "Drive with the displacement of a log, not a wave.", "Motion"
    ),
    "temperature": Keyword(
        "text",
        "TEMP",
        "Of the oil, as in 40degC; after identify --covariate temperature.",
        "Motion",
    ),
    # Trust
    "hold_out": Keyword(
        "texts",
        "PATTERN",
        "Predict these logs instead of fitting them, or segments by frequency or peak speed "
        "(4Hz-10Hz, 0.2m/s-); may be given several times.  [default: "
        "transients, the run-up, coast-down and changes of speed within the logs]",
        "Trust",
        "identification.hold_out",
    ),
    "hold_out_cycles": Keyword(
        "number",
        "N",
        "Hold out the last N cycles of each log; below 1: that share of them.",
        "Trust",
        "identification.hold_out_cycles",
    ),
    "profile": Keyword(
        "quantities",
        "NAME,NAME",
        "Profile the misfit along a parameter, into profiles.csv.",
        "Trust",
        "identification.profile",
    ),
    "repeats": Keyword(
        "paths",
        "RESULTS",
        "Repeat run of A; the scatter of the repeats is the yardstick.",
        "Trust",
    ),
    # Gates
    "strict": Keyword(
        "flag", _FLAG, "Refuse logs that have a warning; ends with code 4.", "Gates", "rig.strict"
    ),
    "max_mse": Keyword(
        "number",
        "PCT",
        "End with code 4 above this MSE.",
        "Gates",
        "output.max_mse_percent",
    ),
    "check": Keyword(
        "names",
        "NAME,NAME",
        "End with code 4 unless these checks pass; purdy2000 is a list of them.",
        "Gates",
        "output.checks",
    ),
    "export.check": Keyword(
        "flag", _FLAG, "Run what was written against the logs of the run; show the error.", "Gates"
    ),
    "tolerance": Keyword(
        "text",
        "5%|20N|FILE",
        "Band around the reference (of a fleet: the median), or a table of bands; missed: code 4.",
        "Gates",
    ),
    "junit": Keyword(
        "path", "FILE.xml", "Write the points of --tolerance as JUnit XML.", "Gates"
    ),
    # Work
    "jobs": Keyword(
        "workers", "N", "Workers, 1 or more.  [default: the cores available]", "Work"
    ),
    "scheduler": Keyword(
        "text", "ADDRESS", "Work on a Dask cluster, as in tcp://10.0.0.1:8786.", "Work"
    ),
    "part": Keyword("text", "I/N", "Only part I of N, as in a job array: 3/100.", "Work"),
    # Output
    "identify.out": Keyword(
        "path", "DIR", "Folder for the results.  [default: results]", "Output", "output.folder"
    ),
    "simulate.out": Keyword("path", "FILE", "Write the signals: .csv or .parquet.", "Output"),
    "sweep.out": Keyword(
        "path", "DIR", "Folder for table and figures.  [default: sweep]", "Output"
    ),
    "compare.out": Keyword("path", "DIR", "Write page, Markdown, JSON and tables.", "Output"),
    "export.out": Keyword(
        "path",
        "PATH",
        "A file if it has a suffix, else a folder.  [default: export in the results folder]",
        "Output",
    ),
    "report.out": Keyword(
        "path", "DIR", "Where to write.  [default: the results folder]", "Output"
    ),
    "fleet.out": Keyword(
        "path", "DIR", "Folder of the fleet's parts.", "Output"
    ),
    "init.out": Keyword(
        "path", "FILE.toml", "Where to write; - prints it.  [default: my_damper.toml]", "Output"
    ),
    "overwrite": Keyword("flag", _FLAG, _REPLACE, "Output"),
    "init.overwrite": Keyword("flag", _FLAG, "Replace the file if it is there.", "Output"),
    "report": Keyword(
        "flag", _FLAG, "Also write report.html, as damperfit report does.", "Output"
    ),
    "fleet.report": Keyword(
        "flag", _FLAG, "Also write the tables and one page of the fleet: fleet.html.", "Output"
    ),
    "figures": Keyword(
        "text", "KIND", "Write the figures as files: png, svg or pdf.", "Output",
        names=("--plots",),
    ),
    "plot": Keyword("path", "FILE", "Draw the loops: .png, .svg or .pdf.", "Output"),
    "to": Keyword("text", "TARGET", "What to write; --list shows them.", "Output"),
    "list": Keyword("flag", _FLAG, "Show the targets with file, units and sign.", "Output"),
    "github_summary": Keyword(
        "flag", _FLAG, "Append the report to the summary of the job.", "Output"
    ),
    "save": Keyword("path", "FILE.json", "Keep A as a baseline.", "Output"),
    "collect": Keyword(
        "flag", _FLAG, "Then write one table of all parts: fleet.parquet, .csv.", "Output"
    ),
    "units": Keyword(
        "text",
        "LIST",
        "Units of force, speed and length, as in N,mm/s or lbf,in/s or daN.  [default: those of "
        "the run or the configuration, else N,m/s,m]",
        "Output",
    ),
    "decimal": Keyword(
        "text", "MARK", "Decimal mark in CSV files: a point or a comma.", "Output"
    ),
    "extend": Keyword(
        "text", "SPEED", "Extend tables beyond the tested speed; marked as untested.", "Output"
    ),
    "json": Keyword(
        "flag", _FLAG, "Print one JSON document on stdout and nothing else there.", "Output"
    ),
    "quiet": Keyword(
        "flag", _FLAG, "No progress bar, no remarks; errors are still shown.", "Output",
        names=("-q",),
    ),
    "log_file": Keyword(
        "path",
        "FILE",
        "Append every message and step to FILE, one line each, with its time.",
        "Output",
    ),
    "debug": Keyword("flag", _FLAG, "Show the traceback of an error."),
    "version": Keyword("flag", _FLAG, "Print the version and exit.", names=("-V",)),
    # Arguments
    "results": _RESULTS,
    "settings.results": Keyword(
        "arguments",
        "RESULTS",
        "Folder that identify wrote, or files of measured curves.  [default: results]",
    ),
    "runs": Keyword(
        "arguments",
        "A B...",
        "Results folders, or folders of several; A is the reference. With --measured also raw "
        "logs: a folder, a quoted pattern or @list.txt of them is one run.",
    ),
    "folder": Keyword("argument", "DIR", "Folder for the logs."),
    "topic": Keyword("argument", "TOPIC", "A page of the manual, or a command."),
}  # fmt: skip

# In the order of the help; what stands in none stands last, under "Options".
PANELS = ("Logs", "Damper", "Rig", "Fit", "Motion", "Trust", "Gates", "Work", "Output", "Options")


def keyword_of(command: str, name: str) -> Keyword | None:
    """Return what a keyword of a command is; None of what takes objects of Python alone.

    Examples
    --------
    >>> keyword_of("identify", "skew").key
    'rig.skew'
    """
    return _KEYWORDS.get(f"{command}.{name}") or _KEYWORDS.get(name)


def option_of(name: str) -> str:
    """Return the option that a keyword is on the command line.

    Examples
    --------
    >>> option_of("hold_out")
    '--hold-out'
    """
    return f"--{name.replace('_', '-')}"


# What a keyword takes in Python.
_TYPES = {
    "text": "str",
    "texts": "list of str",
    "names": "list of str",
    "quantities": "list of str",
    "values": "mapping",
    "pairs": "mapping",
    "number": "float",
    "count": "int",
    "workers": "int",
    "path": "path",
    "results": "Run or path",
    "paths": "list of path",
    "flag": "bool",
}


def with_keywords(function: Callable[..., Any]) -> str:
    """Return the docstring of a function with those of its keywords that it does not tell itself.

    Parameters
    ----------
    function : callable
        Of `damperfit.api`.
    """
    known = function.__doc__ or ""
    told = {
        name.strip().lstrip("*")
        for line in known.splitlines()
        if line[:4].isspace() and line[4:5].strip()
        for name in line.partition(" : ")[0].split(",")
    }
    lines = []
    for name in signature(function).parameters:
        one = _KEYWORDS.get(f"{function.__name__}.{name}") or _KEYWORDS.get(name)
        if one is not None and one.kind in _TYPES and name not in told:
            lines += [f"    {name} : {_TYPES[one.kind]}", f"        {one.help}"]
    if not lines:
        return known
    return "\n".join(
        [known.rstrip(), "", "    Other Parameters", "    ----------------", *lines, ""]
    )


class FunctionPackage(ModuleType):
    """A package of the name of a function: called, it is the function of `damperfit.api`."""

    def __call__(self, *arguments: Any, **given: Any) -> Any:
        """Do what the function does."""
        function = getattr(import_module("damperfit.api"), self.__name__.rpartition(".")[2])
        return function(*arguments, **given)
