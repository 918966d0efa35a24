"""Which column of a log is which channel: declared, or found by words of its name and by its unit.

A name may be any of several languages, with its unit in brackets or behind it, in all the notations
that rigs write; a column with the channel's unit goes before one without, fewer other words before
more. Two columns of time that stand each left of channels of their own are two clocks.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, NamedTuple

from damperfit.errors import LogError, did_you_mean
from damperfit.io.formats import Column
from damperfit.io.options import CHANNELS, EXTRAS, ReadOptions
from damperfit.problem import Option
from damperfit.units.quantities import QuantityError, Unit, find_unit, is_unit, units_of

__all__ = [
    "OWN_TIME",
    "ChannelChoice",
    "choose_channels",
    "has_channel",
    "joined_problems",
    "mentions_channel",
    "split_name",
    "unit_of_channel",
    "visible",
    "words_of_name",
]

OWN_TIME = "time of "  # and the name of the channel that it is of

# English, German, French, Italian, Spanish.
_WORDS = {
    "time": (
        "time", "times", "t", "elapsed", "seconds", "timestamp", "timestamps", "datetime", "zeit",
        "uhrzeit", "temps", "tempo", "tiempo",
    ),
    "displacement": (
        "displacement", "disp", "position", "pos", "stroke", "travel", "extension", "x",
        "distance", "dist", "lvdt", "weg", "hub", "déplacement", "deplacement", "course",
        "spostamento", "corsa", "desplazamiento", "carrera",
    ),
    "force": ("force", "load", "f", "forc", "kraft", "effort", "forza", "fuerza"),
    "temperature": (
        "temperature", "temp", "temperatur", "température", "temperatura",
    ),
    "velocity": (
        "velocity", "vel", "speed", "v", "geschwindigkeit", "vitesse", "velocità", "velocidad",
    ),
    "setting": ("setting",),
}  # fmt: skip
_ALL_WORDS = frozenset(word for words in _WORDS.values() for word in words)
_IN_BRACKETS = re.compile(r"(?P<base>.*?)\s*[(\[]\s*(?P<unit>[^()\[\]]*?)\s*[)\]]\s*", re.DOTALL)
_BEFORE_UNIT = re.compile(r"[_/, ]")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_APART = re.compile(r"[\W_]+")
_NAMES = 512  # remembered, for the logs of a rig have the same


class ChannelChoice(NamedTuple):
    """Where a channel comes from; a setting has no unit, nor has what is left out."""

    column: int  # from 0
    name: str  # as the log names it, or its number
    unit: Unit | None
    note: str = ""  # what was assumed


def visible(text: str, *, limit: int = 60) -> str:
    """Return text from a log in quotes, control characters escaped, shortened.

    Examples
    --------
    >>> visible("a" * 70, limit=5)
    "'aaaaa...'"
    """
    return repr(text if len(text) <= limit else text[:limit] + "...")


@lru_cache(maxsize=_NAMES)
def split_name(name: str) -> tuple[str, str | None]:
    """Return a column's name and the unit inside it.

    Examples
    --------
    >>> split_name("force_N"), split_name("Force (kN)"), split_name("Axial Force")
    (('force', 'N'), ('Force', 'kN'), ('Axial Force', None))
    """
    if match := _IN_BRACKETS.fullmatch(name):
        return match["base"], match["unit"] or None
    for mark in _BEFORE_UNIT.finditer(name, 1):  # from the left, as "mm/s" holds "s"
        unit = name[mark.end() :].strip()
        if is_unit(unit):
            return name[: mark.start()].strip(), unit
    return name, None


@lru_cache(maxsize=_NAMES)
def words_of_name(base: str) -> tuple[str, ...]:
    """Return the words of a name in lower case.

    Examples
    --------
    >>> words_of_name("axialForce_raw")
    ('axial', 'force', 'raw')
    """
    return tuple(word.lower() for word in _APART.split(_CAMEL.sub(" ", base)) if word)


def mentions_channel(names: Iterable[str]) -> bool:
    """Say whether any of the names could be a channel's."""
    return any(_hits(words_of_name(split_name(name)[0]), _ALL_WORDS) for name in names)


def _hits(words: Sequence[str], known: Collection[str]) -> list[str]:
    """Return the words that are known; a letter only by itself, as degF is no force."""
    return [word for word in words if word in known and (len(word) > 1 or len(words) == 1)]


def choose_channels(
    columns: Sequence[Column],
    options: ReadOptions,
    *,
    where: str,
    needs_time: bool = True,
    hint: str = "",
) -> tuple[dict[str, ChannelChoice], tuple[str, ...]]:
    """Return the column of each channel that the log has, and notes.

    Parameters
    ----------
    columns : sequence of Column
        As in the log.
    options : ReadOptions
        Declared columns and units.
    where : str
        Log, for messages.
    needs_time : bool
        False: a sample rate tells the time where no column does.
    hint : str
        Why names may be missing; said where a channel is not found.

    Returns
    -------
    dict
        By channel; a clock that a channel has for itself under `OWN_TIME` and its name.
    tuple of str
        Notes.

    Raises
    ------
    LogError
        A needed channel is missing or there are several; a unit is missing, unknown or of
        another dimension. All that is wrong is said at once.
    """
    chosen: dict[str, ChannelChoice] = {}
    notes: list[str] = []
    lost: list[str] = []
    problems: list[LogError] = []
    clocks = _clocks(columns, options)
    for channel in _WORDS:
        if not has_channel(channel, columns, options):
            is_needed = channel not in {*EXTRAS, "setting"} and (channel != "time" or needs_time)
            lost += [channel] if is_needed else []
            continue
        try:
            index: int | None = clocks.get("force")
            note = ""
            if channel != "time" or index is None:
                index, note = _column_of(channel, columns, options, where)
            notes += [note] if note else []
            if index is None:
                continue
            choice = _with_unit(channel, index, columns[index], options, where)
        except LogError as error:
            problems.append(error)
            continue
        notes += [choice.note] if choice.note else []
        if choice.unit is not None or channel not in EXTRAS:
            chosen[channel] = choice
    if lost:
        problems.insert(0, LogError(_missing(lost, columns, hint), code="no-column"))
    if problems:
        raise joined_problems(problems, where)
    for channel, clock in clocks.items():
        if channel in chosen and clock != clocks["force"]:
            own = _with_unit("time", clock, columns[clock], options, where)
            chosen[f"{OWN_TIME}{channel}"] = own
    for name in options.adjusters:
        named = [
            i
            for i, column in enumerate(columns)
            if "_".join(words_of_name(split_name(column.name)[0])) == name.casefold()
        ]
        if name not in chosen and len(named) == 1:
            chosen[name] = ChannelChoice(named[0], name, None)
    return chosen, tuple(notes)


def _clocks(columns: Sequence[Column], options: ReadOptions) -> dict[str, int]:
    """Return the column of time left of each channel, where there is not one for all."""
    if options.columns.get("time", "") != "":
        return {}
    ranked = _candidates("time", columns)
    stamps = [i for *_, i in ranked if any(is_unit(u, "time") for u in _units_of(columns[i]))]
    clocks: dict[str, int] = {}
    for channel in ("force", "displacement", *EXTRAS):
        found = [i for *_, i in sorted(_candidates(channel, columns)) if i not in stamps]
        left = [i for i in stamps if found and i < found[0]]
        if left:
            clocks[channel] = left[-1]
    is_apart = {"force", "displacement"} <= clocks.keys()
    return clocks if is_apart and clocks["force"] != clocks["displacement"] else {}


def _units_of(column: Column) -> tuple[str | None, str | None]:
    return column.unit, split_name(column.name)[1]


def has_channel(channel: str, columns: Sequence[Column], options: ReadOptions) -> bool:
    """Say whether a column is declared or named as the channel."""
    return options.columns.get(channel, "") != "" or bool(_candidates(channel, columns))


def unit_of_channel(
    channel: str, index: int, column: Column, options: ReadOptions, where: str
) -> Unit:
    """Return the unit of a column that holds a channel.

    Raises
    ------
    LogError
        There is none, it is unknown or of another dimension.
    """
    choice = _with_unit(channel, index, column, options, where)
    if choice.unit is None:
        first = units_of(CHANNELS[channel])[0]
        raise LogError(
            f"column {choice.name} has no unit of {channel}; write it into the name or "
            f"declare it in rig.units ({{declared}})",
            declared=Option("rig", first, f"units.{channel}"),
            subject=where,
        )
    return choice.unit


def joined_problems(problems: Sequence[LogError], subject: str) -> LogError:
    """Return one error for all that is wrong with a log.

    Examples
    --------
    >>> print(joined_problems([LogError("no column for time"), LogError("no unit")], "a.csv"))
    a.csv: 2 things are wrong: (1) no column for time; (2) no unit
    """
    if len(problems) == 1:
        return problems[0].at(subject=subject)
    parts: dict[str, Any] = {
        f"problem_{i}": problem.at(subject="") for i, problem in enumerate(problems, start=1)
    }
    listed = "; ".join(f"({i}) {{{name}}}" for i, name in enumerate(parts, start=1))
    text = f"{len(problems)} things are wrong: {listed}"
    return LogError(text, code=problems[0].problem.code, subject=subject, **parts)


def _label(index: int, column: Column) -> str:
    return visible(column.name) if column.name else f"number {index + 1}"


def _listed(columns: Sequence[Column]) -> str:
    shown = [_label(i, column) for i, column in enumerate(columns[:20])]
    return ", ".join(shown) + (", ..." if len(columns) > 20 else "")


def _column_of(
    channel: str, columns: Sequence[Column], options: ReadOptions, where: str
) -> tuple[int | None, str]:
    """Return the column and a note: as declared, or best by unit, then by fewest other words."""
    declared = options.columns.get(channel, "")
    if isinstance(declared, int):  # nor is 0 a column
        if not 1 <= declared <= len(columns):
            raise LogError(
                f"{channel} is declared as column {declared}, but there are {len(columns)} columns",
                subject=where,
            )
        best = [declared - 1]
    elif declared:
        best = [i for i, column in enumerate(columns) if column.name == declared.strip()]
        if not best:
            hint = did_you_mean(declared, [column.name for column in columns])
            raise LogError(
                f"no column {visible(declared)} for {channel}; there are {_listed(columns)}.{hint}",
                subject=where,
            )
    else:
        ranked = _candidates(channel, columns)
        best = [i for *rank, i in ranked if rank == [*min(ranked)[:2]]]
    first = columns[best[0]]
    if len(best) > 1 and len({columns[i].name for i in best}) == 1:
        numbers = " and ".join(str(i + 1) for i in best)
        raise LogError(
            f"columns {numbers} are both named {visible(first.name)}; "
            f"declare the number of the one that is the {channel} in rig.columns",
            subject=where,
        )
    if len(best) > 1:
        names = " or ".join(_label(i, columns[i]) for i in best)
        if channel in EXTRAS:
            return None, f"{channel}: left out; it could be column {names}: declare which"
        raise LogError(
            f"{channel} could be column {names}; declare which in rig.columns", subject=where
        )
    note = f"{channel}: column {_label(best[0], first)}"
    if declared != "":
        return best[0], f"{note}, as declared"
    is_plain = split_name(first.name)[0].lower() == channel or first.is_clock  # has its own note
    return best[0], "" if is_plain else note


def _candidates(channel: str, columns: Sequence[Column]) -> list[tuple[bool, int, int]]:
    """Return (lacks the unit, words beside the channel's own, index) of columns that may be it."""
    candidates = []
    for i, column in enumerate(columns):
        base, unit = split_name(column.name)
        words = words_of_name(base)
        if hits := _hits(words, _WORDS[channel]):
            is_sure = column.is_clock or _is_unit_of(column.unit or unit, channel)
            candidates.append((not is_sure, len(words) - len(hits), i))
    if channel == "time" and not candidates:  # times of day need no name
        return [(False, 0, i) for i, column in enumerate(columns) if column.is_clock]
    return candidates


def _is_unit_of(unit: str | None, channel: str) -> bool:
    return channel in CHANNELS and is_unit(unit, CHANNELS[channel])


def _missing(channels: Sequence[str], columns: Sequence[Column], hint: str) -> str:
    if not any(column.name for column in columns):
        found = f"{hint}: correct the names, or" if hint else "the columns have no names;"
        return (
            f"{found} declare the numbers and units of time, displacement and force in "
            "rig.columns and rig.units"
        )
    beside = f" ({hint})" if hint else ""
    bases = {split_name(column.name)[0].lower(): column.name for column in columns}
    hints = ""
    for channel in channels:
        near = [m for word in _WORDS[channel] for m in get_close_matches(word, bases, 1, 0.7)]
        of_it = f" for {channel}" if len(channels) > 1 else ""
        hints += f" Did you mean {visible(bases[near[0]])}{of_it}?" if near else ""
    names = ", ".join(f"rig.columns.{channel} = 'NAME'" for channel in channels)
    advice = f" Name {'them' if len(channels) > 1 else 'it'}: {names}"
    if "force" in channels:
        advice += "; without a force nothing can be fitted"
    which = " and ".join(part for part in (", ".join(channels[:-1]), channels[-1]) if part)
    return f"no column for {which}{beside}; there are {_listed(columns)}.{hints}{advice}"


def _with_unit(
    channel: str, index: int, column: Column, options: ReadOptions, where: str
) -> ChannelChoice:
    name = _label(index, column)
    if channel == "setting":
        return ChannelChoice(index, name, None)
    dimension = CHANNELS[channel]
    if column.is_clock:
        if channel != "time":
            raise LogError(
                f"column {name} holds times of day, declared as {channel}", subject=where
            )
        note = f"time: wall clock in column {name}"
        return ChannelChoice(index, name, find_unit("s", dimension), note)
    logged = column.unit or split_name(column.name)[1]
    if declared := options.units.get(channel):
        unit = find_unit(declared, dimension)
        is_other = _is_unit_of(logged, channel) and find_unit(logged or "", dimension) != unit
        beside = f" although the log says {logged}" if is_other else ""
        return ChannelChoice(index, name, unit, f"{channel}: unit {declared}, as declared{beside}")
    if logged is None:
        if channel in EXTRAS:
            return ChannelChoice(index, name, None, f"{channel}: left out; it has no unit")
        raise LogError(
            f"column {name} has no unit, needed for {channel}; write it into the name, "
            f"as in {channel}_{units_of(dimension)[0]}, or declare it in rig.units "
            "({declared})",
            declared=Option("rig", units_of(dimension)[0], f"units.{channel}"),
            subject=where,
        )
    try:
        return ChannelChoice(index, name, find_unit(logged, dimension))
    except QuantityError as error:
        if channel == "velocity":  # a motor's, in revolutions per minute
            return ChannelChoice(index, name, None, f"velocity: left out; column {name}: {error}")
        is_volts = is_unit(logged, "voltage")
        advice = f" For volts declare rig.scales and the unit in rig.units of the {channel}."
        raise LogError(f"column {name}: {error}{advice * is_volts}", subject=where) from error
