"""The first configuration of a damper of your own: what its logs show, what must be measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from damperfit.conditioning.log_to_trace import condition
from damperfit.conditioning.options import ConditionOptions
from damperfit.conditioning.polarity import CONTRADICTED, UNKNOWN
from damperfit.configuration.damper_section import damper_defaults
from damperfit.configuration.drawings import DRAWINGS, MEASURED
from damperfit.configuration.loading import load_configuration, toml_value
from damperfit.configuration.options import Configuration
from damperfit.damper.model import model_named
from damperfit.errors import ConditioningError, ConfigurationError, DamperfitError, LogError
from damperfit.io import ReadOptions, read_logs
from damperfit.io.labels import guess_settings, unclear_names
from damperfit.io.tests_table import facts_in
from damperfit.laws.structures import LAYOUTS
from damperfit.problem import Option, note
from damperfit.recording import Recording
from damperfit.statistics import median
from damperfit.tested.identity import IDENTITY_KEYS, common_identity, identity_in

_FEW = 3  # logs that are read; the others are named alike
# Units that are tried for a column that says none, the likeliest first.
_UNITS = {"time": ("s", "ms"), "displacement": ("mm", "m", "in"), "force": ("N", "kN", "lbf")}
# What a damper's test looks like: amplitude in m, peak force in N, duration in s.
_LIKELY = ((5e-4, 0.25), (30.0, 5e4), (0.2, 7200.0))
_DOUBTED = {"direction", CONTRADICTED}  # findings that ask for the signs


@dataclass(frozen=True, slots=True)
class Guessed:
    """What logs show of the rig and the test."""

    rig: Mapping[str, Any]  # keys of [rig]
    test: Mapping[str, str]  # keys of [test] that all logs agree in
    why: tuple[str, ...] = ()  # a sentence for each guess
    open: tuple[str, ...] = ()  # what they do not show, a sentence each
    adjusters: tuple[str, ...] = ()  # names of the adjusters, where their names show several
    damper: Mapping[str, str] = field(default_factory=dict)  # keys of [damper], of all logs
    asks_signs: bool = False  # somebody must decide them

    @property
    def without_model(self) -> Guessed:
        """The same where no model is named."""
        text = (
            "the model is not named: [damper] has the keys of the paper's; name one "
            f"({', '.join(LAYOUTS)}) by {{--model}}, or let the logs choose: identify "
            "{--model auto}"
        )
        return replace(self, open=(str(note("no-model", text)), *self.open))


def guess_from_logs(logs: Sequence[Path], model: str, values: Mapping[str, str]) -> Guessed:
    """Return what logs show: units, setting, signs, and identity of the damper."""
    rig: dict[str, Any] = {}
    guesses: list[str] = []
    unknown: list[str] = []
    unreadable: list[str] = []
    options = load_configuration().reading
    recordings: list[Recording] = []
    for path in logs[:_FEW]:
        try:
            of_file, units = _read(path, options)
        except DamperfitError as error:
            unreadable.append(str(error))
            continue
        recordings += of_file
        amplitude, _, duration = _sizes(of_file[0])
        reasons = {
            "time": f"the log then lasts {duration:.3g} s",
            "displacement": f"its amplitude is then {1e3 * amplitude:.3g} mm",
            "force": f"its largest is then {np.max(np.abs(of_file[0].force)):.4g} N",
        }
        for channel, unit in units.items():
            if rig.setdefault("units", {}).setdefault(channel, unit) == unit and path == logs[0]:
                guesses.append(f"{channel} is read in {unit}: {reasons[channel]}")
    lacks_setting = any(recording.setting is None for recording in recordings)
    lacks_setting |= bool(recordings and unclear_names(path.name for path in logs))
    guess = guess_settings(path.name for path in logs)
    if lacks_setting and (guess.settings or guess.adjusters):
        rig["setting_pattern"] = guess.pattern
        places = f"the names differ in the places of {' and '.join(guess.adjusters)}"
        guesses.append(str(guess.finding).partition(";")[0] if guess.settings else places)
    elif lacks_setting:
        offered = f": {guess.advice}" if guess.advice else ""
        unknown.append(
            "the logs do not say their setting: name them setting_10.csv, write '# setting: 10' "
            f"into them, or give a table tests.csv or rig.setting_pattern{offered}"
        )
    configuration = _load(model, values)
    signs = [_signs(recording, configuration.conditioning) for recording in recordings]
    assumed = f" (judged by the gas of {configuration.whose}: fill in [damper], then inspect)"
    assumed *= configuration.is_assumed
    for channel in ("displacement", "force"):
        if signs and all(channel in reversed_ for reversed_, _ in signs):
            rig[f"reverse_{channel}"] = True
            guesses.append(f"{channel} is positive in compression: the loops show it{assumed}")
    if doubt := next((doubt for _, doubt in signs if doubt), ""):
        doubt_text = doubt.partition("; taken as logged")[0].partition("; declare")[0]
        unknown.append(
            f"signs{assumed}: {doubt_text}; decide reverse_displacement and reverse_force in [rig]"
        )
    identity = common_identity(identity_in(recording.metadata) for recording in recordings)
    facts = {key: getattr(identity, key) for key in IDENTITY_KEYS}
    test = {key: value for key, value in facts.items() if value and "," not in value}
    gases = {facts_in(recording.metadata)[0].get("gas_pressure") for recording in recordings}
    gas = gases.pop() if len(gases) == 1 else None
    damper = {} if gas is None else {"gas_pressure": f"{1e-5 * gas:.5g}bara"}
    adjusters = guess.adjusters if rig.get("setting_pattern") == guess.pattern else ()
    unknown += unreadable[:1]  # the others are named alike, and `inspect` names them all
    opens = tuple(dict.fromkeys(unknown))
    return Guessed(rig, test, tuple(guesses), opens, adjusters, damper, asks_signs=bool(doubt))


def _read(path: Path, options: ReadOptions) -> tuple[tuple[Recording, ...], dict[str, str]]:
    """Read a log, with likely units for columns that say none; and these units."""
    try:
        return read_logs(path, options), {}
    except LogError as error:
        keys = [option.key for option in error.problem.offered if option.name == "rig"]
        lacking = [channel for channel in _UNITS if f"units.{channel}" in keys]
        if not lacking:
            raise
    for chosen in product(*(_UNITS[channel] for channel in lacking)):
        units = dict(zip(lacking, chosen, strict=True))
        declared = load_configuration(overlay={"rig": {"units": units}}).reading
        recordings = read_logs(path, declared)
        if all(
            low <= size <= high
            for recording in recordings
            for size, (low, high) in zip(_sizes(recording), _LIKELY, strict=True)
        ):
            return recordings, units
    raise LogError(
        f"columns without units, and no common units give plausible values: "
        f"declare rig.units ({', '.join(lacking)})",
        subject=path.name,
        code="no-unit",
    )


def _sizes(recording: Recording) -> tuple[float, float, float]:
    """Amplitude, m, peak force, N, and duration, s."""
    amplitude = float(np.ptp(recording.displacement)) / 2.0
    force = float(np.max(np.abs(recording.force - median(recording.force))))
    return amplitude, force, float(recording.time[-1] - recording.time[0])


def _signs(recording: Recording, options: ConditionOptions) -> tuple[list[str], str]:
    """Return which channels the loop shows to be reversed, and why the signs are in doubt."""
    try:
        trace = condition(recording, options)
    except ConditioningError as error:
        return [], str(error) if error.problem.code == UNKNOWN else ""
    # A note is certain; where it is a warning the direction is not known.
    certain = {finding.code for finding in trace.findings if finding.severity == "note"}
    doubts = (finding.message() for finding in trace.findings if finding.code in _DOUBTED)
    turned = [name for name in ("displacement", "force") if f"{name}_polarity" in certain]
    return turned, next(doubts, "")


_PASSAGE = """\
#
# [[damper.passages]]              # one for each passage; else those of damperfit config
# from = 1                         # chamber: 1 rod side, 2 full bore, 3 gas
# to = 2
# law = "orifice"                  # or check, linear, ...: damperfit help models
# name = "rebound"
# two_way = true""".splitlines()


_ADJUSTERS = [
    "# [adjusters]                      # more than one: in the order of labels such as R12 C8",
    '# rebound = "from open"',
    '# compression = "from open"',
]


def first_configuration(model: str | None, values: Mapping[str, str], guessed: Guessed) -> str:
    """Return a commented TOML: what was given, what the logs show, what is to be measured."""
    kind = model_named(model or "purdy")
    lines = [
        "# Configuration of one damper and its rig: damperfit identify LOGS --config THIS_FILE.",
        "# A key with # in front has its default; damperfit config prints all keys and defaults.",
        "",
        "[damper]",
        f'{"# " * (model is None)}model = "{kind.name}"',
    ]
    if kind.name in DRAWINGS:
        lines += ["#", *(f"# {line}".rstrip() for line in DRAWINGS[kind.name].splitlines()), "#"]
    defaults = damper_keys(kind.name)
    values = {**guessed.damper, **values}
    for key, text in defaults.items():
        value = toml_value(_plain(values.get(key, text)))
        mark = "" if key in values else "# "
        comment = MEASURED.get(key, "")
        entry = f"{mark}{key} = {value}"
        lines.append(f"{entry:<34} # {comment}" if comment else entry)
    if kind.name == "network":
        lines += _PASSAGE
    lines += ["", "[test]"]
    lines += [f"{key} = {toml_value(value)}" for key, value in guessed.test.items()]
    lines += [
        *(f'# {key} = ""' for key in ("damper", "serial", "operator") if key not in guessed.test),
        "",
        "[rig]",
        *(f"# {' '.join(sentence.split())}" for sentence in guessed.why),
    ]
    lines += [f"{key} = {toml_value(value)}" for key, value in guessed.rig.items()]
    lines += [f"# open: {' '.join(sentence.split())}" for sentence in guessed.open]
    if guessed.asks_signs:
        lines += [
            "# reverse_displacement = true     # the log counts compression (rod in) as positive",
            "# reverse_force = true            # remove the #, or declare both false",
        ]
    lines += [
        '# columns = {time = "NAME"}        # channels whose columns are not recognised',
        "# temperature_tolerance = inf      # ask for no temperature",
        "",
    ]
    if guessed.adjusters:
        lines.append(
            '[adjusters]                        # clicks count "from open" or "from closed"'
        )
        lines += [f'{name} = ""' for name in guessed.adjusters]
    else:
        lines += _ADJUSTERS
    return "\n".join(lines) + "\n"


def damper_keys(model: str) -> dict[str, str]:
    """Return the plain keys of [damper] and their defaults, as text."""
    return {
        key: str(value).lower() if isinstance(value, bool) else str(value)
        for key, value in damper_defaults(model).items()
        if key not in {"model", "reference_temperature"} and not isinstance(value, dict | list)
    }


def _plain(value: Any) -> Any:
    """Return text as a TOML value: numbers and booleans are not strings."""
    if value in {"true", "false"}:
        return value == "true"
    try:
        return float(value)
    except ValueError:
        return value


def check_damper(model: str, values: Mapping[str, str]) -> None:
    """Refuse unknown keys of [damper] and impossible values."""
    options = {f"damper.{key}": Option("set", key=key) for key in values}
    options["damper.model"] = Option("model")
    _load(model, values, options)


def fault_of(model: str, key: str, text: str) -> str:
    """Return what is wrong with one key of [damper], whatever the others are; "" if nothing is.

    Examples
    --------
    >>> fault_of("purdy", "rod_diameter", "12bar")
    "rod_diameter: no unit of length 'bar'; expected m, mm, cm, um, in, found '12bar'"
    >>> fault_of("purdy", "rod_diameter", "32mm")  # the piston comes next
    ''
    """
    try:
        _load(model, {key: text}, {f"damper.{key}": Option("set", key=key)})
    except ConfigurationError as error:
        option, values = error.problem.where, error.problem.values
        is_of_key = isinstance(option, Option) and option.key == key and "beside" not in values
        return f"{key}: {error.problem.message()}" if is_of_key else ""
    return ""


def _load(
    model: str, values: Mapping[str, str], options: Mapping[str, Option] = MappingProxyType({})
) -> Configuration:
    plain = {key: _plain(text) for key, text in values.items()}
    return load_configuration(overlay={"damper": {"model": model, **plain}}, options=dict(options))
