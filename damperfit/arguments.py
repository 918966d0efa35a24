"""Keywords of functions and options of commands, each defined once, and how they are read.

A function of `damperfit.api` names its keywords in its signature; kind and meaning of a keyword
stand here, or with the key of the configuration that it sets (`damperfit.sections`). The command of
the same name makes its options of both. An entry ``command.keyword`` takes precedence over that of
the keyword alone.

A command passes texts and a call in Python values; both are read by the kinds of the keywords,
refused with the name of the option or the keyword, and put into a configuration.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import cache, wraps
from inspect import Parameter, signature
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, TypeVar

from damperfit.errors import UNWRITTEN, ConfigurationError, DamperfitError, refuse_wrong_arguments
from damperfit.problem import FilePlace, Option, Words
from damperfit.sections import SECTIONS
from damperfit.store import path_of
from damperfit.tested.setting import Setting, label_of

if TYPE_CHECKING:
    from damperfit.configuration.options import Configuration
    from damperfit.results import Run

    P = ParamSpec("P")
    R = TypeVar("R")

_OPTION = re.compile(r"--([a-z][a-z-]*)")
# Options of a command's output, and keywords that take objects of Python.
PRESENTATION = (
    *("json", "quiet", "debug", "version", "log_file", "github_summary", "list"),
    *("color", "no_progress", "verbose"),
)
_OF_PYTHON = {
    "damper": "The damper, or keys of [damper]; by default that of `config`, else the paper's.",
    "watch": "Receives the progress, and may ask to stop.",
    "stop": "Ends it when it is set; Ctrl-C does so too.",
    "on_law": "Called with the name of each law that was tried.",
    "inspect.units": "Units of columns that do not say theirs.",
}
# In the order of the help; a keyword without a panel is under "Options".
PANELS = ("Logs", "Damper", "Rig", "Fit", "Motion", "Trust", "Gates", "Work", "Output", "Options")


class Keyword(NamedTuple):
    """One keyword, and the option that it is on the command line."""

    # text, texts, names, quantities (names in lower case), values (of quantities, NAME=VALUE),
    # pairs (KEY=VALUE), number, count, workers, path, paths, results, arguments or flag; or the
    # words that may be given, with | between them
    kind: str
    metavar: str
    help: str
    panel: str = "Options"  # where the help shows it
    key: str = ""  # of the configuration, as in "rig.skew"; empty: it sets none
    names: tuple[str, ...] = ()  # other spellings of the option


# What sets no key, by panel: kind, word for the value, help, other spellings.
# fmt: off
_ROWS: dict[str, dict[str, tuple[Any, ...]]] = {
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
        "folder": ("argument", "DIR", "Folder for the logs."),
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
        "ride.setting": ("text", "N", "This setting alone."),
        "cd": ("number", "C_D", "Discharge coefficient of the orifices."),
        "cd_spread": ("number", "N", "How far it may be off; it widens the intervals."),
        "seat": ("text", "LENGTH", "Diameter of the blow-off's seat, as in 8mm."),
        "reference": ("results", "RESULTS", "Earlier run of the damper: what has worn since?"),
        "watch.reference": ("results", "RESULTS", "What forces are compared with."),
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
    },
    "Fit": {
        "rivals": ("flag", "",
            "Also rank fourteen models from the literature, with --model auto."),
        "covariate": ("text", "temperature",
            "Let viscous resistances follow the temperature of each log; one beta for all."),
    },
    "Motion": {
        "car": ("table", "FILE.toml", "[car]: masses, spring, tyre, motion ratio, road, speed."),
        "ride.stroke": ("path", "LOG",
            "Time and damper displacement of a car, in place of the road."),
        "samples.cycles": ("number", "N", "Cycles in a log."),
        "samples.sample_rate": ("text", "RATE", "Samples per second, as in 1000Hz."),
        "settings.velocity": ("text", "SPEED", "At this speed, as in 0.2m/s; minus: compression."),
        "valves.velocity": ("text", "SPEED", "At this speed, as in 0.2m/s; minus: compression."),
        "valves.force": ("text", "FORCE", "Which orifice or preload gives it? As in 900N."),
        "compare.velocity": ("texts", "SPEED",
            "Speeds to compare at.  [default: the named test speeds]"),
        "stroke": ("text", "NAME", "rebound or compression, instead of a sign."),
        "force": ("text", "FORCE", "Which setting gives it? As in 900N; minus: compression."),
        "without_gas": ("flag", "", "Leave the gas force out of all forces, as a dyno can."),
        "vary": ("texts", "NAME=F1,F2",
            "Scale by these factors: r_m1 r_m2 r_m3 k_e f_f f_0 p_0 gamma amplitude frequency."),
        "paper": ("flag", "",
            "Figures 4 to 9 of the paper, at setting 10 unless --setting says otherwise."),
        "displacement": ("path", "LOG", "Drive with the displacement of a rig's log, not a wave."),
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
        "figures": ("png|svg|pdf", "KIND", "Write the figures as files: png, svg or pdf.",
            "--plots"),
        "plot": ("path", "FILE", "Draw the loops: .png, .svg or .pdf."),
        "ride.plot": ("path", "FILE",
            "Draw wheel load against comfort, or the speeds of the stroke: .png, .svg or .pdf."),
        "to": ("text", "TARGET", "What to write; --list shows them."),
        "schema": ("flag", "",
            "Print the JSON schema of configuration files, for an editor, and exit."),
        "list": ("flag", "", "Show the targets with file, units and sign."),
        "github_summary": ("flag", "", "Append the report to the summary of the job."),
        "save": ("path", "FILE.json", "Keep A as a baseline."),
        "collect": ("flag", "", "Then write one table of all parts: _fleet/fleet.parquet, .csv."),
        "decimal": (".|,", "MARK", "Decimal mark in CSV files: a point or a comma."),
        "extend": ("text", "SPEED", "Extend tables beyond the tested speed; marked as untested."),
        "json": ("flag", "", "Print one JSON document on stdout and nothing else there."),
        "quiet": ("flag", "", "No progress bar, no notes; errors are still shown.", "-q"),
        "verbose": ("flag", "",
            "Show each step on stderr: logs read, fits, times, files written.", "-v"),
        "log_file": ("path", "FILE",
            "Append every message and step to FILE, one line each, with its time."),
        "color": ("text", "WHEN",
            "Colours on stdout: auto, always or never.  [default: auto, on a terminal]"),
        "no_progress": ("flag", "", "No progress bar."),
    },
    "Trust": {
        "for_": ("text", "NAME|force@SPEED|law",
            "What is to be known better: k_e, force@0.05m/s (minus: compression), law."),
        "advise.setting": ("text", "N", "Plan for this setting alone."),
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


@cache
def _keywords() -> dict[str, Keyword]:
    keywords = {}
    for section, fields in SECTIONS.items():
        for name, entry in fields.entries().items():
            if not entry.panel:
                continue
            kind, default = entry.kind or _KINDS.get(type(entry.default), "text"), entry.default
            text = entry.about[:1].upper() + entry.about[1:]
            if kind in {"texts", "values"} and "|" not in entry.option:
                text += "; may be given several times"
            text += "."
            if default and not isinstance(default, list | dict) and "default" not in text:
                written = f"{default:g}" if isinstance(default, float) else default
                text += f"  [default: {written}]"
            place = (entry.panel, f"{section}.{name}")
            keywords[entry.keyword or name] = Keyword(kind, entry.option, text, *place)
    for panel, rows in _ROWS.items():
        for name, (kind, metavar, text, *names) in rows.items():
            keywords[name] = Keyword(kind, metavar, text, panel, "", tuple(names))
    return keywords


def keyword_of(command: str, name: str) -> Keyword | None:
    """Return a keyword of a command; None where it takes objects of Python alone.

    >>> keyword_of("identify", "skew").key
    'rig.skew'
    """
    if {name, f"{command}.{name}"} & {*_OF_PYTHON}:
        return None
    return _keywords().get(f"{command}.{name}") or _keywords().get(name)


def option_of(name: str) -> str:
    """Return the option of a keyword on the command line."""
    return f"--{name.rstrip('_').replace('_', '-')}"


def with_keywords(function: Callable[..., Any]) -> str:
    """Return the docstring of a function with the keywords that it does not describe itself."""
    text, command = function.__doc__ or "", function.__name__
    documented = {
        name.strip().lstrip("*")
        for line in text.splitlines()
        if line[:4].isspace() and line[4:5].strip()
        for name in line.partition(" : ")[0].split(",")
    }
    lines, parameters = [], signature(function).parameters

    def spelled(option: re.Match[str]) -> str:
        """An option that is no keyword of the function stays as it is."""
        name = option[1].replace("-", "_")
        return f"{name}=" if name in parameters else option[0]

    for name, parameter in parameters.items():
        keyword = keyword_of(command, name)
        meaning = _OF_PYTHON.get(name) or _OF_PYTHON.get(f"{command}.{name}")
        if keyword is not None:
            meaning = _OPTION.sub(spelled, keyword.help)
        if meaning is not None and name not in documented:
            kind = str(parameter.annotation).removesuffix(" | None")
            kind = kind if kind != "object" else "path, pattern, list of such, or labelled frames"
            lines += [f"    {name} : {kind}", f"        {meaning}"]
    title = "Other Parameters" if "    Parameters\n" in text else "Parameters"
    heading = ["", f"    {title}", f"    {'-' * len(title)}"]
    return "\n".join([text.rstrip(), *heading, *lines, ""]) if lines else text


# How they are read

_ASSIGNMENT = re.compile(r"\s*[A-Za-z_]\w*\s*=")
_NEXT_ASSIGNMENT = re.compile(r",(?=\s*[A-Za-z_]\w*\s*=)")
# What a path is of, by the word that stands for it in the help.
_PLACES = {
    "DIR": "a folder",
    "RESULTS": "a folder",
    "FILE.toml": "a TOML file",
    "LOG": "a log",
    "PATH": "a file or folder",
}
_RESULT = "a result, or the path of a results folder"
_TABLE = "a result, or the path of results or of a parameters table"
_QUANTITIES = {"SPEED", "FORCE", "LENGTH", "FREQ", "RATE", "TEMP", "POWER"}
_NO_NUMBERS = {"bool", "bool_", "bytes"}  # NumPy's too


def usage(
    text: str, code: str, where: Option | str | None = None, **values: Any
) -> ConfigurationError:
    """Return the refusal of an option, or of a call by its name."""
    place: dict[str, Any] = {"subject": where} if isinstance(where, str) else {"where": where}
    return ConfigurationError(text, code=code, **place, **values)


def public(function: Callable[P, R]) -> Callable[P, R]:
    """Return a function that reads and documents its arguments, and names itself in errors."""
    call = f"damperfit.{function.__name__}"
    function.__doc__ = with_keywords(function)
    reading = refuse_wrong_arguments(call)(reading_as(function.__name__)(function))

    @wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return reading(*args, **kwargs)
        except DamperfitError as error:
            error.words = Words(call)
            raise

    return called


def reading_as(command: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator: a function gets its arguments as read by their kinds."""

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        declared = signature(function)

        @wraps(function)
        def reading(*args: P.args, **kwargs: P.kwargs) -> R:
            bound = declared.bind(*args, **kwargs)
            paths: list[tuple[str, Any]] = []

            def read(name: str, given: Any) -> Any:
                keyword = keyword_of(command, name)
                if given is None or keyword is None:
                    return given
                value = _read(keyword, given, Option(name))
                if keyword.kind in {"path", "paths", "results", "table"}:
                    places = given if isinstance(given, str | list) else value
                    places = places if isinstance(places, list) else [places]
                    paths.extend((name, path) for path in places if isinstance(path, str | Path))
                return value

            for name, given in list(bound.arguments.items()):
                kind = declared.parameters[name].kind
                if kind is Parameter.VAR_KEYWORD:
                    bound.arguments[name] = {key: read(key, value) for key, value in given.items()}
                elif kind is not Parameter.VAR_POSITIONAL:
                    bound.arguments[name] = read(name, given)
            try:
                return function(*bound.args, **bound.kwargs)
            except DamperfitError as error:
                raise _given_by(error, paths) from error.__cause__

        return reading

    return decorated


def _given_by(error: DamperfitError, paths: Iterable[tuple[str, Any]]) -> DamperfitError:
    """Return an error about a file with the argument that named the file."""
    where, place = error.problem.where, error.problem.subject
    if isinstance(where, FilePlace) and where.option is None:
        place = where.file
    elif where is not None or not place:
        return error
    for name, path in paths:
        itself = {os.path.normpath(path)}
        with suppress(OSError, ValueError):  # the working folder is gone
            itself.add(os.path.realpath(str(path)))
        if error.problem.code in UNWRITTEN:
            itself.add(os.path.dirname(path))  # noqa: PTH120 - as it was given
        is_itself = not itself.isdisjoint({place, os.path.normpath(place)})
        if not is_itself and itself.isdisjoint(map(str, Path(place).parents)):
            continue
        if isinstance(where, FilePlace):
            file = str(path) if is_itself else where.file
            return error.at(where._replace(file=file, option=Option(name)))
        return error.at(Option(name, path if is_itself else ""), subject="" if is_itself else place)
    return error


def _read(keyword: Keyword, value: Any, option: Option) -> Any:  # noqa: C901, PLR0911, PLR0912 - a kind each
    """Return an argument as read by its kind."""
    place = f"the path of {_PLACES.get(keyword.metavar, 'a file')}"
    match keyword.kind:
        case "table" if isinstance(value, Mapping):
            return value
        case "path" | "table":
            return path_of(value, option, place)
        case "paths":
            return [path_of(path, option, place) for path in _listed(value, option)]
        case "results":
            return results_of(value, option, _TABLE)
        case "arguments" if isinstance(value, list) and any(
            type(v) is str and not v for v in value
        ):
            text = "found ''; expected paths; is a variable of the shell not set? '.' is "
            raise usage(f"{text}this folder", "empty-name")
        case "texts":
            return value if isinstance(value, Mapping) else _listed(value, option)
        case "names" | "quantities":
            names = [n.strip() for text in _listed(value, option) for n in str(text).split(",")]
            return names if keyword.kind == "names" else [name.lower() for name in names]
        case "values" | "pairs" if option.name == "rig":
            return _rig_keys(value)
        case "values" | "pairs" if not isinstance(value, list):
            return {name: str(entry) for name, entry in _mapping(value, option).items()}
        case "values":
            return _values(value, option)
        case "pairs":
            return assignments(value, option, "rod_diameter=12mm")
        case "text" if option.name == "tolerance" and not isinstance(value, str | Path):
            # A bare number would be newtons, and may be meant as per cent.
            text = f"found {value!r}; expected '5%', '20N' or the path of a table of bands"
            raise usage(text, "not-a-tolerance", option)
        case "text" if option.name == "tolerance":
            return str(value)
        case "text" if keyword.metavar in _QUANTITIES:
            return str(value)
        case kind if "|" in kind and value not in kind.split("|"):
            text = f"expected {kind.replace('|', ' or ')}"
            raise usage(text, "unknown-word", option._replace(value=value))
        case "text" if isinstance(value, Real):
            return label_of(value) or value
        case "flag" if not isinstance(value, bool):
            raise usage(f"found {value!r}; expected True or False", "not-a-flag", option)
        case "count" | "workers" | "number":
            return _number(keyword.kind, value, option._replace(value=str(value)))
    return value


def _number(kind: str, value: Any, option: Option) -> Any:
    """Return a number, or an integer of any length; True is none."""
    number = None
    if type(value).__name__ not in _NO_NUMBERS:
        with suppress(TypeError, ValueError, OverflowError):
            digits = re.sub(r"\.0*$", "", str(value).strip())
            number = float(value) if kind == "number" else int(digits)
    if number is None:
        text = f"expected a {'whole ' * (kind != 'number')}number"
        raise usage(text, "not-a-number", option)
    if kind == "workers" and number < 1:
        raise usage("expected 1 or more", "out-of-range", option)
    return number


def results_of(given: object, where: Option | str, expected: str = _RESULT) -> Path | Run:
    """Return the path of results; a run that is not saved as it is."""
    from damperfit.results import Run

    if isinstance(given, Run):
        return given if given.place is None else given.place
    if isinstance(where, str) and not isinstance(given, str | Path):
        text = f"found {type(given).__name__}; expected {expected}"
        raise usage(text, "not-a-result", where)
    path = path_of(given, where, expected)
    if path.suffix.lower() == ".json" and where != "damperfit.compare":
        from damperfit.queries.compared import is_baseline

        if is_baseline(path):
            text = "a baseline or passport, which compare reads; give the results it was made of"
            raise usage(text, "baseline", str(path))
    return path


def workers(jobs: int | None) -> int:
    """Return the number of workers; None: as many as there are cores."""
    from damperfit.workers import available_cores

    return jobs or available_cores()


def _listed(values: object, option: Option) -> list[Any]:
    is_speed = isinstance(values, Real) and option.name == "velocity"
    if isinstance(values, str | os.PathLike) or is_speed:
        return [values]
    if not isinstance(values, Iterable):
        raise usage(f"found {values!r}; expected a list of names", "not-a-list", option)
    return list(values)


def _mapping(value: object, option: Option) -> Mapping[Any, Any]:
    expected = "expected a mapping of names to values"
    if not isinstance(value, Mapping):
        found = repr(value) if isinstance(value, str | float | list) else type(value).__name__
        raise usage(f"found {found}; {expected}", "not-a-mapping", option)
    if wrong := [name for name in value if not isinstance(name, str)]:
        text = f"found {wrong[0]!r} in place of a name; {expected}"
        raise usage(text, "not-a-mapping", option)
    return value


def _values(texts: Sequence[str], option: Option) -> dict[str, str]:
    """Return values by quantity, of NAME=VALUE texts and lists of them; K_e is k_e."""
    items = (item.partition("=") for text in texts for item in _NEXT_ASSIGNMENT.split(str(text)))
    return assignments([f"{name.lower()}{mark}{value}" for name, mark, value in items], option)


def assignments(
    texts: Iterable[str], option: Option, example: str = "k_e=5e8", *, may_be_empty: bool = False
) -> dict[str, str]:
    """Return NAME=VALUE texts as a dictionary; refuse other texts, and a name given twice."""
    values: dict[str, str] = {}
    for text in texts:
        name, equals, value = (piece.strip() for piece in text.partition("="))
        where = option._replace(value=text)
        if not (name and equals and (value or may_be_empty)):
            raise usage(f"expected NAME=VALUE, such as {example}", "not-an-assignment", where)
        if name in values:
            raise usage(f"{name} is given twice", "given-twice", where)
        values[name] = value
    return values


def _rig_keys(given: Any) -> dict[str, Any]:
    """Return keys of [rig]: of a mapping, or of KEY=VALUE texts, in TOML or (kN, nothing) text."""
    option = Option("rig")
    if not isinstance(given, list | tuple):
        return dict(_mapping(given, option))
    import json
    import tomllib

    keys: dict[str, Any] = {}
    texts = assignments(given, option, "units.force=kN", may_be_empty=True)
    for key, value in texts.items():
        for text in (value, json.dumps(value)):
            with suppress(tomllib.TOMLDecodeError):
                parsed = tomllib.loads(f"{key} = {text}")
                break
        else:
            raise usage(f"{key!r} is not a key", "not-a-key", Option("rig", value, key))
        for name, entry in parsed.items():
            is_table = isinstance(entry, dict) and isinstance(keys.get(name), dict)
            keys[name] = keys[name] | entry if is_table else entry
    return keys


def starts_of(given: Any) -> tuple[str | None, dict[str, str]]:
    """Return the file and the values that ``start`` gives, values one by one or in lists.

    >>> starts_of(["results", "f_f=30,k_e=2e9"]), starts_of({"f_f": 30})
    (('results', {'f_f': '30', 'k_e': '2e9'}), (None, {'f_f': '30'}))
    """
    if isinstance(given, Mapping):
        return None, {str(name): str(value) for name, value in given.items()}
    texts = [str(given)] if isinstance(given, str | Path) else [str(text) for text in given or []]
    files: list[str] = []
    values: list[str] = []
    for text in texts:
        for piece in [text] if _is_there(text) else _NEXT_ASSIGNMENT.split(text):
            is_value = _ASSIGNMENT.match(piece) and not _is_there(piece)
            (values if is_value else files).append(piece)
    if len(files) > 1:
        text = f"{files[0]} is given already; a fit starts from one earlier run"
        raise usage(text, "given-twice", Option("start", files[1]))
    if "" in files:
        text = "expected a file or NAME=VALUE, such as k_e=5e8"
        raise usage(text, "not-an-assignment", Option("start", "''"))
    return (files[0] if files else None), _values(values, Option("start"))


def _is_there(text: str) -> bool:
    """Whether a text names a file; a list of values may be longer than any name."""
    with suppress(OSError, ValueError):
        return Path(text).exists()
    return False


def configured(
    command: str, given: Mapping[str, Any], *extra: tuple[str, str, Any], is_law_open: bool = False
) -> Configuration:
    """Return the configuration for the arguments of a command, by keyword.

    None, and a flag that is not set, count as not given. `extra` are a keyword, the key that it
    sets, and the value, where that differs from the keyword's. `is_law_open`: the logs choose the
    law.
    """
    from damperfit.configuration.loading import load_configuration

    sections: dict[str, dict[str, Any]] = {}
    options: dict[str, Option] = {}

    def put(place: str, value: Any, option: Option) -> None:
        section, _, key = place.partition(".")
        sections.setdefault(section, {})[key] = value
        options[place] = option

    if given.get("damper") is not None:
        sections["damper"] = _declared(given["damper"])
    handled = {"start", "units", *(keyword for keyword, _, _ in extra)}
    for keyword, value in given.items():
        entry = keyword_of(command, keyword)
        is_nothing = value is None or value is False or value == {}
        if entry is not None and entry.key and keyword not in handled and not is_nothing:
            put(entry.key, str(value) if isinstance(value, Path) else value, Option(keyword))
    for keyword, place, value in extra:
        if value is not None:
            put(place, value, Option(keyword))
    rig, units = given.get("rig"), given.get("units")
    for key, value in ({} if rig is None else _rig_keys(rig)).items():
        put(f"rig.{key}", value, Option("rig", key=key))
    if isinstance(units, str):
        put("output.units", units, Option("units"))
    elif units is not None:
        units_of_rig = sections.get("rig", {}).get("units", {})
        put("rig.units", {**units_of_rig, **_mapping(units, Option("units"))}, Option("units"))
    return load_configuration(
        given.get("config"), overlay=sections, options=options, is_law_open=is_law_open
    )


def _declared(damper: Any) -> dict[str, Any]:
    from damperfit.damper.model import Model

    if isinstance(damper, Model):
        model: Any = damper
        return {"model": model.name, **asdict(model)}
    if isinstance(damper, Mapping):
        return dict(_mapping(damper, Option("damper")))
    found = f"the class {damper.__name__}" if isinstance(damper, type) else type(damper).__name__
    text = (
        f"found {found}; expected a damper such as damperfit.Damper(rod_diameter=0.012), or keys "
        "of [damper]"
    )
    raise usage(text, "not-a-damper", Option("damper"))


def covaried(command: str, given: Mapping[str, Any], *, of_fleet: bool = False) -> Any:
    """Return the reference temperature that ``covariate="temperature"`` asks for.

    One that the configuration file names stays. Otherwise it is the mean of the logs; for a fleet,
    whose dampers are compared, the nominal temperature of the test.
    """
    covariate = given.get("covariate")
    if covariate is None:
        return None
    where = Option("covariate", covariate)
    if covariate != "temperature":
        raise usage("expected temperature, the only one there is", "unknown-covariate", where)
    if given.get("model") == "auto":
        text = (
            "choose the model first, from logs of one temperature (damperfit models), then name "
            "it: {--model NAME}"
        )
        raise usage(text, "not-together", where)
    configuration = configured(command, {n: given.get(n) for n in ("config", "damper", "model")})
    reference: str | float = configuration.document["damper"]["reference_temperature"]
    if reference != "none":
        return reference
    return configuration.rig.temperature if of_fleet else "mean"


def declared_setting(setting: Any, configuration: Configuration) -> Setting | None:
    """Return the setting of a label or number."""
    from damperfit.tested.setting import parse_setting

    if not isinstance(label := known_as_setting(setting), str):
        return label
    try:
        return parse_setting(label, configuration.reading.adjusters)
    except ValueError as error:
        raise usage(f"{error}", "unknown-setting", Option("setting", label)) from error


def known_as_setting(setting: Any) -> Setting | str | None:
    """Return the label of a setting or a number, or a `Setting` as it is."""
    if setting is None or isinstance(setting, Setting):
        return setting
    if (label := label_of(setting)) is None:
        text = f"found {type(setting).__name__}; expected a setting such as 10 or 'R12 C8'"
        raise usage(text, "not-a-setting", Option("setting"))
    return label


def refuse_idle(
    given: Mapping[str, Any], names: Sequence[str], reason: str, *, beside: Option | None = None
) -> None:
    """Refuse arguments without effect, or that cannot be combined with the option `beside`."""
    for name in names:
        if (value := given.get(name)) is None:
            continue
        where = Option(name, value if value is True else _worded(value))
        if beside is None:
            raise usage(f"{{where}} has no effect: {reason}; leave it out", "no-effect", where)
        text = f"{{where}} cannot be combined with {{other}}: {reason}; leave one of the two out"
        raise usage(text, "not-together", where, other=beside)


def _worded(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(
            f"{key}.{_worded(entry)}" if isinstance(entry, Mapping) else f"{key}={entry}"
            for key, entry in value.items()
        )
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
