"""Which column is which channel, and in which unit: from names, units rows and declarations."""

from __future__ import annotations

import re
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from damperfit.errors import LogError, did_you_mean
from damperfit.io.options import CHANNELS, EXTRAS
from damperfit.problem import Option
from damperfit.units.quantities import QuantityError, Unit, find_unit, is_unit, units_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from damperfit.io.formats import Column
    from damperfit.io.options import ReadOptions

__all__ = [
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

# English, German, French, Italian, Spanish.
_WORDS = {
    "time": (
        "time", "t", "elapsed", "seconds", "timestamp", "datetime", "zeit", "uhrzeit", "temps",
        "tempo", "tiempo",
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
_OPTIONAL = (*EXTRAS, "setting")
_IN_BRACKETS = re.compile(r"(?P<base>.*?)\s*[(\[]\s*(?P<unit>[^()\[\]]*?)\s*[)\]]\s*", re.DOTALL)
_BEFORE_UNIT = re.compile(r"[_/, ]")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_APART = re.compile(r"[\W_]+")
_NAMES = 512  # remembered, for the logs of a rig have the same


@dataclass(frozen=True, slots=True)
class ChannelChoice:
    """Where a channel comes from.

    Attributes
    ----------
    index : int
        Column, from 0.
    name : str
        Column as the log names it, or its number.
    unit : Unit or None
        None for the setting, which has no unit.
    note : str
        What was assumed; empty when the name says it all.
    """

    index: int
    name: str
    unit: Unit | None
    note: str = ""


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
    if found := _IN_BRACKETS.fullmatch(name):
        return found["base"], found["unit"] or None
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
    known = {word for words in _WORDS.values() for word in words}
    return any(_hits(words_of_name(split_name(name)[0]), known) for name in names)


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
    for channel in _WORDS:
        declared = options.columns.get(channel, "")
        if declared == "" and not _candidates(channel, columns):
            if channel not in _OPTIONAL and (channel != "time" or needs_time):
                lost.append(channel)
            continue
        try:
            index, note = _found_index(channel, declared, columns, where)
            found = index is not None and _with_unit(channel, index, columns[index], options, where)
        except LogError as error:
            problems.append(error)
            continue
        notes += [note] if note else []
        if not found:
            continue
        notes += [found.note] if found.note else []
        if not (found.note and found.unit is None and channel in EXTRAS):
            chosen[channel] = found
    if lost:
        problems.insert(0, LogError(_missing(lost, columns, hint), code="no-column"))
    if problems:
        raise joined_problems(problems, where)
    for name in options.adjusters:
        columns_of = [i for i, column in enumerate(columns) if _is_named(column, name)]
        if name not in chosen and len(columns_of) == 1:
            chosen[name] = ChannelChoice(columns_of[0], name, None)
    return chosen, tuple(notes)


def _is_named(column: Column, adjuster: str) -> bool:
    return "_".join(words_of_name(split_name(column.name)[0])) == adjuster.casefold()


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
        f"problem_{i}": one.at(subject="") for i, one in enumerate(problems, start=1)
    }
    listed = "; ".join(f"({i}) {{{name}}}" for i, name in enumerate(parts, start=1))
    text = f"{len(problems)} things are wrong: {listed}"
    return LogError(text, code=problems[0].problem.code, subject=subject, **parts)


def _label(index: int, column: Column) -> str:
    return visible(column.name) if column.name else f"number {index + 1}"


def _listed(columns: Sequence[Column]) -> str:
    shown = [_label(i, column) for i, column in enumerate(columns[:20])]
    return ", ".join(shown) + (", ..." if len(columns) > 20 else "")


def _declared_index(
    channel: str, declared: str | int, columns: Sequence[Column], where: str
) -> int:
    if isinstance(declared, int):
        if not 1 <= declared <= len(columns):
            raise LogError(
                f"{channel} is declared as column {declared}, but there are {len(columns)} columns",
                subject=where,
            )
        return declared - 1
    found = [i for i, column in enumerate(columns) if column.name == declared.strip()]
    if not found:
        hint = did_you_mean(declared, [column.name for column in columns])
        raise LogError(
            f"no column {visible(declared)} for {channel}; there are {_listed(columns)}.{hint}",
            subject=where,
        )
    if len(found) > 1:
        raise LogError(_duplicate(channel, found, columns, where))
    return found[0]


def _duplicate(channel: str, found: Sequence[int], columns: Sequence[Column], where: str) -> str:
    numbers = " and ".join(str(i + 1) for i in found)
    return (
        f"{where}: columns {numbers} are both named {visible(columns[found[0]].name)}; "
        f"declare the number of the one that is the {channel} in rig.columns"
    )


def _found_index(
    channel: str, declared: str | int, columns: Sequence[Column], where: str
) -> tuple[int | None, str]:
    """Return the column and a note: best by unit, then by fewest words beside the channel's."""
    if declared != "":  # nor is 0 a column, which is said there
        index = _declared_index(channel, declared, columns, where)
        return index, f"{channel}: column {_label(index, columns[index])}, as declared"
    ranked = _candidates(channel, columns)
    best = min(ranked)[:2]
    found = [i for *rank, i in ranked if tuple(rank) == best]
    if len(found) == 1:
        base = split_name(columns[found[0]].name)[0]
        is_plain = base.lower() == channel or columns[found[0]].is_clock  # the clock has its note
        note = "" if is_plain else f"{channel}: column {_label(found[0], columns[found[0]])}"
        return found[0], note
    if len({columns[i].name for i in found}) == 1:
        raise LogError(_duplicate(channel, found, columns, where))
    names = " or ".join(_label(i, columns[i]) for i in found)
    if channel in EXTRAS:
        return None, f"{channel}: left out; it could be column {names}: declare which"
    raise LogError(
        f"{channel} could be column {names}; declare which in rig.columns", subject=where
    )


def _candidates(channel: str, columns: Sequence[Column]) -> list[tuple[bool, int, int]]:
    """Return (lacks the unit, words beside the channel's own, index) of columns that may be it."""
    found = []
    for i, column in enumerate(columns):
        base, unit = split_name(column.name)
        words = words_of_name(base)
        hits = _hits(words, _WORDS[channel])
        if hits:
            is_sure = column.is_clock or _is_unit_of(column.unit or unit, channel)
            found.append((not is_sure, len(words) - len(hits), i))
    if channel == "time" and not found:  # times of day need no name
        return [(False, 0, i) for i, column in enumerate(columns) if column.is_clock]
    return found


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
    inside = split_name(column.name)[1]
    found = column.unit or inside
    declared = options.units.get(channel)
    if declared:
        unit = find_unit(declared, dimension)
        is_other = _is_unit_of(found, channel) and find_unit(found or "", dimension) != unit
        said = f" although the log says {found}" if is_other else ""
        return ChannelChoice(index, name, unit, f"{channel}: unit {declared}, as declared{said}")
    if found is None:
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
        return ChannelChoice(index, name, find_unit(found, dimension))
    except QuantityError as error:
        if channel == "velocity":  # a motor's, in revolutions per minute
            return ChannelChoice(index, name, None, f"velocity: left out; column {name}: {error}")
        volts = is_unit(found, "voltage")
        advice = f" For volts declare rig.scales and the unit in rig.units of the {channel}."
        raise LogError(f"column {name}: {error}{advice * volts}", subject=where) from error
