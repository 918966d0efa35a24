"""Checks, trends and clicks on their way into run.json and back: one class for both.

Folders of other versions and damaged ones come here too, so nothing is taken on trust: an entry
that is another thing is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from functools import cache
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, TypeVar, cast, get_args, get_origin, get_type_hints

from damperfit.adjustment.clicks import Click
from damperfit.adjustment.trends import Trend
from damperfit.checks import Check
from damperfit.problem import SEVERITIES, Failure, Problem
from damperfit.tested.setting import Setting, parse_place
from damperfit.units.quantities import QuantityError
from damperfit.units.shown_units import SI, ShownUnits, parse_units

if TYPE_CHECKING:
    Record = Mapping[str, Any]

_T = TypeVar("_T")
# Names in run.json where they are not those of the fields.
_KEYS: dict[type, dict[str, str]] = {
    Click: {
        "first": "from",
        "second": "to",
        "speed": "speed_m_per_s",
        "change": "change_N",
        "low": "low_N",
        "high": "high_N",
    },
}
_PLAIN = frozenset({float, int, str, bool, type(None)})


def to_record(value: Any) -> Any:
    """Return a check, trend or click as what run.json holds."""
    if type(value) in _PLAIN:  # nearly all there is: asked for first
        return value
    if isinstance(value, Setting):
        return value.cell
    if is_dataclass(value):
        kind: Any = type(value)
        return {key: to_record(getattr(value, name)) for name, key in _keys_of(kind)}
    if isinstance(value, tuple):
        return [to_record(item) for item in value]
    if isinstance(value, dict):
        return {str(key): to_record(item) for key, item in value.items()}
    return value


@cache
def _keys_of(kind: Any) -> tuple[tuple[str, str], ...]:
    """Return the name of each field, and the key that stands for it in run.json."""
    keys = _KEYS.get(kind, {})
    return tuple((field.name, keys.get(field.name, field.name)) for field in fields(kind))


@cache
def _hints(kind: Any) -> dict[str, Any]:
    """Return the kind of each field; what is only written need not have them all at hand."""
    return get_type_hints(kind, localns={"Setting": Setting, "Mapping": dict})


def read_back(kind: type[_T], entry: object) -> _T | None:
    """Return what `to_record` was given; None where the entry, anything at all, is another thing.

    What it lacks reads as not known: NaN, None, an empty text.
    """
    try:
        item: _T = _read(kind, entry)
    except (TypeError, ValueError, OverflowError):
        return None
    return item


def _read(hint: Any, value: Any) -> Any:
    """Return a value as its kind, or what stands for an unknown one."""
    if isinstance(hint, UnionType):
        kinds = [kind for kind in get_args(hint) if kind is not NoneType]
        if value is None and len(kinds) < len(get_args(hint)):
            return None
        is_label = isinstance(value, str)
        hint = next((kind for kind in kinds if (kind is str) == is_label), kinds[0])
    if get_origin(hint) is tuple:
        kinds, items = list(get_args(hint)), list(value or ())
        kinds = kinds[:1] * len(items) if kinds[-1] is Ellipsis else kinds
        return tuple(_read(kind, item) for kind, item in zip(kinds, items, strict=True))
    if is_dataclass(hint) and hint is not Setting:
        entry, kind = dict(value), cast("Any", hint)
        keyed = [(name, key, _hints(kind)[name]) for name, key in _keys_of(kind)]
        values = {name: _read(inner, entry.get(key)) for name, key, inner in keyed}
        if next(iter(values.values())) == "":  # what the entry is about
            raise ValueError
        return kind(**values)
    return _READ[hint](value)


def _whole(value: Any) -> int:
    if isinstance(value, bool) or value != int(value):
        raise ValueError
    return int(value)


def _number(value: Any) -> float:
    with suppress(OverflowError):  # JSON knows whole numbers of any length
        if isinstance(value, int | float) and not isinstance(value, bool):
            return float(value)
    return math.nan


def _text(value: object) -> str:
    return value if isinstance(value, str) else "" if value is None else str(value)


_READ: dict[Any, Callable[[Any], Any]] = {
    float: _number,
    int: _whole,
    str: _text,
    bool: lambda value: value is True,
    Setting: lambda value: Setting.of(
        parse_place(value) if isinstance(value, str) else _whole(value)
    ),
}


# What a record holds


def inside(document: object, *keys: str) -> Any:
    """Return what stands below keys, one in the other; None where there is no such place."""
    for key in keys:
        document = document.get(key) if isinstance(document, dict) else None
    return document


def listed_in(record: Record, key: str) -> list[Any]:
    """Return a list of the record, empty where there is none."""
    value = record.get(key)
    return value if isinstance(value, list) else []


def entries_in(record: Record, key: str) -> list[dict[str, Any]]:
    """Return the objects in a list of the record; none where somebody put something else there."""
    kinds = str | int | float | None  # of a setting
    entries = [entry for entry in listed_in(record, key) if isinstance(entry, dict)]
    return [entry for entry in entries if isinstance(entry.get("setting"), kinds)]


def number_in(record: Record, key: str) -> float | None:
    """Return a finite number of the record, None where there is none."""
    number = _number(record.get(key))
    return number if math.isfinite(number) else None


def all_in(record: Record, key: str, kind: type[_T]) -> list[_T]:
    """Return what a list of the record holds, as it was given to `to_record`."""
    items = (read_back(kind, entry) for entry in listed_in(record, key))
    return [item for item in items if item is not None]


def checks_in(record: Record) -> list[Check]:
    """Return the checks in the order of the record."""
    return all_in(record, "checks", Check)


def trends_in(record: Record) -> list[Trend]:
    """Return the trends by parameter, their points by setting."""
    return [
        replace(trend, points=tuple(sorted(trend.points, key=lambda point: point.setting)))
        for trend in all_in(record, "trends", Trend)
    ]


def units_in(record: Record) -> ShownUnits:
    """Return the units in which the run was shown; SI where it does not say."""
    units = inside(record, "configuration", "output", "units")
    with suppress(QuantityError):
        return parse_units(units) if isinstance(units, str) else SI
    return SI


def failures_in(record: Record) -> tuple[Failure, ...]:
    """Return the logs and settings that have no result, with what kind of problem it is."""
    failures = []
    for entry in listed_in(record, "failures"):
        with suppress(TypeError, ValueError, AttributeError):
            names = ("kind", "message", "log", "path")
            kind, message, log, path = (_text(entry.get(name)) for name in names)
            setting = _read(Setting | None, entry.get("setting"))
            if kind and message:
                text = message.removeprefix(f"{log}: ")  # of older runs, without a text
                problem = Problem.of_record({"text": text, "subject": log, **entry})
                problem = replace(problem, severity="error")
                failures.append(Failure(problem, kind, log, path, setting))
    return tuple(failures)


def problems_in(record: Record, key: str = "problems") -> list[Problem]:
    """Return what to know before believing the numbers; older runs stored plain sentences."""
    problems = []
    for entry in listed_in(record, key):
        with suppress(TypeError, KeyError, AttributeError):
            problems.append(Problem.of_record(entry))
    texts = listed_in(record, "warnings" if key == "problems" else "")
    sentences = [Problem(str(text), str(text), "warning") for text in texts]
    return [problem for problem in problems if problem.severity in SEVERITIES] or sentences


def gaps_in(record: Record) -> tuple[tuple[int, int], ...]:
    """Return the runs of settings without a result, first and last of each."""
    gaps = listed_in(record, "gaps")
    pairs = [(gap.get("first"), gap.get("last")) for gap in gaps if isinstance(gap, dict)]
    pairs += [(setting, setting) for setting in gaps]  # before 0.2 every setting was listed
    return tuple(
        (first, last)
        for first, last in pairs
        if type(first) is int and type(last) is int and first <= last
    )


def sentences_in(record: Record, subject: str) -> list[str]:
    """Return what the run said of a subject, such as "identifiability"; older runs said nothing."""
    return list(map(str, listed_in({subject: inside(record, "sentences", subject)}, subject)))


def law_in(record: Record) -> Record:
    """Return the choice of the model structure; empty where the logs chose none."""
    choice = record.get("law_choice")
    return choice if isinstance(choice, dict) else {}
