"""Which column of a log is which channel: declared, or found by words of its name and by its unit.

A name may be any of several languages, with its unit in brackets or behind it, in all the notations
that rigs write. A column with the channel's unit is preferred to one without, fewer other words to
more. Two columns of time, each to the left of other channels, are two clocks.
"""

import re
from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, NamedTuple

from damperfit.errors import LogError, did_you_mean
from damperfit.io.formats import Column
from damperfit.io.options import CHANNELS, EXTRAS, ReadOptions
from damperfit.problem import Option, in_a_row
from damperfit.units.quantities import QuantityError, Unit, find_unit, is_unit, units_of

OWN_TIME = "time of "  # and the name of the channel that it is of

_COUNTED = {"seconds": "s", "millis": "ms", "micros": "us"}  # clocks named for their units
# English, German, French, Italian, Spanish.
WORDS = {
    "time": (
        "time", "times", "t", "ts", "elapsed", "timestamp", "timestamps", "datetime",
        "zeit", "temps", "tempo", "tiempo", "epoch", "unix", *_COUNTED,
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
_ENDINGS: dict[str, str | tuple[str, ...]] = {  # of German compounds: Kolbenweg, Dämpferkraft
    "time": "zeit", "displacement": ("weg", "nhub", "rhub"), "force": "kraft",
    "temperature": "temperatur", "velocity": "geschwindigkeit",
}  # fmt: skip
_COMMANDED = {
    *("command", "commanded", "cmd", "setpoint", "demand", "target", "reference", "soll"),
    *("sollwert", "consigne"),
}
_LAST = 100  # words; a command is taken where nothing measured is there
_NO_UNIT = {"1", "-", "--", "n/a", "none"}  # what a row of units has of raw values
_ALL_WORDS = frozenset(word for words in WORDS.values() for word in words)
_IN_BRACKETS = re.compile(r"(?P<base>.*?)\s*[(\[]\s*(?P<unit>[^()\[\]]*?)\s*[)\]]\s*", re.DOTALL)
_BEFORE_UNIT = re.compile(r"[_/, ]")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_APART = re.compile(r"[\W_]+")


class ChannelChoice(NamedTuple):
    """Where a channel comes from; a setting has no unit, nor has what is left out."""

    column: int  # from 0
    unit: Unit | None
    note: str = ""  # what was assumed


def visible(text: str, *, limit: int = 60) -> str:
    """Return text from a log in quotes, control characters escaped, shortened."""
    return repr(text if len(text) <= limit else text[:limit] + "...")


@lru_cache(maxsize=512)  # the logs of a rig have the same names
def split_name(name: str) -> tuple[str, str | None]:
    """Return a column's name and the unit inside it."""
    if match := _IN_BRACKETS.fullmatch(name):
        return match["base"], match["unit"] or None
    for mark in _BEFORE_UNIT.finditer(name, 1):  # from the left, as "mm/s" holds "s"
        unit = name[mark.end() :].strip()
        if is_unit(unit):
            return name[: mark.start()].strip(), unit
    return name, None


@lru_cache(maxsize=512)
def words_of_name(base: str) -> tuple[str, ...]:
    """Return the words of a name in lower case."""
    return tuple(word.lower() for word in _APART.split(_CAMEL.sub(" ", base)) if word)


def mentions_channel(names: Iterable[str]) -> bool:
    """Say whether any of the names could be a channel's; a letter by itself may be."""
    every = (words_of_name(split_name(name)[0]) for name in names)
    return any(
        word in _ALL_WORDS and (len(word) > 1 or len(words) == 1)
        for words in every
        for word in words
    )


def has_channel(channel: str, columns: Sequence[Column], options: ReadOptions) -> bool:
    """Say whether a column is declared or named as the channel."""
    return options.columns.get(channel, "") != "" or bool(_candidates(channel, columns))


def choose_channels(  # noqa: PLR0912  # every channel in turn, all problems in one error
    columns: Sequence[Column],
    options: ReadOptions,
    *,
    needs_time: bool = True,
    hint: str = "",
) -> tuple[dict[str, ChannelChoice], tuple[str, ...]]:
    """Return the column of each channel that the log has, and notes.

    The clock of a single channel is under `OWN_TIME` and its name; with a sample rate no column of
    time is needed. `hint` says why names may be missing.
    """
    chosen: dict[str, ChannelChoice] = {}
    notes: list[str] = []
    missing: list[str] = []
    problems: list[LogError] = []
    clocks = _clocks(columns, options)
    needed = {"displacement": True, "time": needs_time, "force": options.needs_force}
    for channel in WORDS:
        if not has_channel(channel, columns, options):
            missing += [channel] * needed.get(channel, False)
            continue
        try:
            index, note = clocks.get("force"), ""
            if channel != "time" or index is None:
                index, note = _column_of(channel, columns, options)
            notes += [note] * (note != "")
            if index is None:
                continue
            choice = ChannelChoice(index, None)
            if channel != "setting":
                choice = channel_choice(channel, index, columns[index], options)
        except LogError as error:
            problems.append(error)
            continue
        notes += [choice.note] * (choice.note != "")
        if choice.unit is not None or channel not in EXTRAS:
            chosen[channel] = choice
    if missing:
        problems.insert(0, LogError(_missing(missing, columns, hint), code="no-column"))
    if problems:
        raise joined_problems(problems)
    for channel, clock in clocks.items():
        if channel in chosen and clock != clocks.get("force"):
            choice = channel_choice("time", clock, columns[clock], options)
            chosen[f"{OWN_TIME}{channel}"] = choice
    names = ["_".join(words_of_name(split_name(column.name)[0])) for column in columns]
    for adjuster in options.adjusters:
        if adjuster not in chosen and names.count(adjuster.casefold()) == 1:
            chosen[adjuster] = ChannelChoice(names.index(adjuster.casefold()), None)
    return chosen, tuple(notes)


def _clocks(columns: Sequence[Column], options: ReadOptions) -> dict[str, int]:
    """Return the column of time left of each channel, where there is not one for all."""
    if options.columns.get("time", "") != "":
        return {}
    stamps = [
        i
        for *_, i in _candidates("time", columns)
        if is_unit(columns[i].unit, "time") or is_unit(split_name(columns[i].name)[1], "time")
    ]
    clocks: dict[str, int] = {}
    for channel in ("force", "displacement", *EXTRAS):
        columns_of = [i for *_, i in sorted(_candidates(channel, columns)) if i not in stamps]
        if before := [i for i in stamps if columns_of and i < columns_of[0]]:
            clocks[channel] = before[-1]
    has_two = {"force", "displacement"} <= clocks.keys()
    return clocks if has_two and clocks["force"] != clocks["displacement"] else {}


def _candidates(channel: str, columns: Sequence[Column]) -> list[tuple[bool, int, int]]:
    """Return (lacks the unit, words beside the channel's own, index) of columns that may be it."""
    candidates = []
    for i, column in enumerate(columns):
        base, unit = split_name(column.name)
        words, has_unit = words_of_name(base), _is_unit_of(column.unit or unit, channel)
        # A letter counts by itself, or beside its unit: degF is no force.
        counts_letters = has_unit or len(words) == 1
        matching = [w for w in words if _names(w, channel) and (len(w) > 1 or counts_letters)]
        if matching:
            n_others = len(words) - len(matching) + _LAST * (not _COMMANDED.isdisjoint(words))
            candidates.append((not (column.is_clock or has_unit), n_others, i))
    if channel == "time" and not candidates:  # times of day need no name
        return [(False, 0, i) for i, column in enumerate(columns) if column.is_clock]
    return candidates


def _names(word: str, channel: str) -> bool:
    return word in WORDS[channel] or word.endswith(_ENDINGS.get(channel, "\0"))


def _is_unit_of(unit: str | None, channel: str) -> bool:
    return channel in CHANNELS and is_unit(unit, CHANNELS[channel])


def _label(index: int, column: Column) -> str:
    return visible(column.name) if column.name else f"number {index + 1}"


def _listed(columns: Sequence[Column]) -> str:
    labels = [_label(i, column) for i, column in enumerate(columns[:20])]
    return ", ".join(labels) + (", ..." if len(columns) > 20 else "")


def _column_of(
    channel: str, columns: Sequence[Column], options: ReadOptions
) -> tuple[int | None, str]:
    """Return the column and a note: as declared, or best by unit, then by fewest other words."""
    declared, names = options.columns.get(channel, ""), [column.name for column in columns]
    if isinstance(declared, int):  # nor is 0 a column
        best = [declared - 1] * (1 <= declared <= len(columns))
        text = f"{channel} is declared as column {declared}, but there are {len(columns)} columns"
    elif declared:
        best = [i for i, name in enumerate(names) if name == declared.strip()]
        hint = did_you_mean(declared, names)
        text = f"no column {visible(declared)} for {channel}; there are {_listed(columns)}.{hint}"
    else:
        ranked = _candidates(channel, columns)
        best, text = [i for *rank, i in ranked if rank == [*min(ranked)[:2]]], ""
    if not best:
        raise LogError(text, code="no-column")
    first, label = columns[best[0]], _label(best[0], columns[best[0]])
    if len(best) > 1:
        labels = " or ".join(_label(i, columns[i]) for i in best)
        problem = f"{channel} could be column {labels}; declare which in rig.columns"
        if len({names[i] for i in best}) == 1:
            numbers = " and ".join(str(i + 1) for i in best)
            problem = (
                f"columns {numbers} are both named {visible(first.name)}; declare the number of "
                f"the one that is the {channel} in rig.columns"
            )
        elif channel in EXTRAS:
            return None, f"{channel}: left out; it could be column {labels}: declare which"
        raise LogError(problem, code="unclear-column")
    if declared != "":
        return best[0], f"{channel}: column {label}, as declared"
    is_plain = split_name(first.name)[0].lower() == channel or first.is_clock  # has its own note
    return best[0], "" if is_plain else f"{channel}: column {label}"


def channel_choice(channel: str, index: int, column: Column, options: ReadOptions) -> ChannelChoice:
    """Return a column with the unit of its channel: declared, or as the log has it.

    An extra channel without one is left out: its unit is None, and the note says so.
    """
    name, dimension = _label(index, column), CHANNELS[channel]
    if column.is_clock:
        if channel != "time":
            text = f"column {name} holds times of day, declared as {channel}"
            raise LogError(text, code="unclear-column")
        return ChannelChoice(index, find_unit("s", dimension), f"time: wall clock in column {name}")
    logged = column.unit or split_name(column.name)[1]
    if logged is not None and logged.lower() in _NO_UNIT:
        logged = None
    if channel == "time":
        logged = logged or _COUNTED.get(column.name.strip("() ").lower())
    if declared := options.units.get(channel):
        unit = find_unit(declared, dimension)
        is_other = _is_unit_of(logged, channel) and find_unit(logged or "", dimension) != unit
        conflict = f" although the log says {logged}" if is_other else ""
        return ChannelChoice(index, unit, f"{channel}: unit {declared}, as declared{conflict}")
    if logged is None:
        if channel in EXTRAS:
            return ChannelChoice(index, None, f"{channel}: left out; it has no unit")
        example = units_of(dimension)[0]
        raise LogError(
            f"column {name} has no unit, needed for {channel}; write it into the name, as in "
            f"{channel}_{example}, or declare it in rig.units ({{declared}})",
            declared=Option("rig", example, f"units.{channel}"),
            code="no-unit",
        )
    try:
        return ChannelChoice(index, find_unit(logged, dimension))
    except QuantityError as error:
        if channel == "velocity":  # a motor's, in revolutions per minute
            return ChannelChoice(index, None, f"velocity: left out; column {name}: {error}")
        unit_of = units_of(dimension)[0]
        advice = (
            f"; of volts declare rig.scales.{channel}, {unit_of} a {logged}, and "
            f"rig.units.{channel} = '{unit_of}'"
        ) * is_unit(logged, "voltage")
        raise LogError(f"column {name}: {error}{advice}", code="unclear-column") from error


def joined_problems(problems: Sequence[LogError]) -> LogError:
    """Return one error for all that is wrong with a log."""
    if len(problems) == 1:
        return problems[0]
    values: dict[str, Any] = {
        f"problem_{i}": problem.at(subject=problem.problem.subject.lstrip(", "))
        for i, problem in enumerate(problems, start=1)
    }
    listed = "; ".join(f"({i}) {{{name}}}" for i, name in enumerate(values, start=1))
    text = f"{len(problems)} things are wrong: {listed}"
    return LogError(text, code=problems[0].problem.code, **values)


def _missing(channels: Sequence[str], columns: Sequence[Column], hint: str) -> str:
    if not any(column.name for column in columns):
        start = f"{hint}: correct the names, or" if hint else "the columns have no names;"
        return (
            f"{start} declare the numbers and units of time, displacement and force in "
            "rig.columns and rig.units"
        )
    used = {i for channel in WORDS for *_, i in _candidates(channel, columns)}
    units = {
        c.name: c.unit or split_name(c.name)[1] for i, c in enumerate(columns) if i not in used
    }
    bases = {split_name(name)[0].lower(): name for name in units}
    hints = ""
    for channel in channels:
        near = [m for word in WORDS[channel] for m in get_close_matches(word, bases, 1, 0.7)]
        by_unit = [name for name, unit in units.items() if _is_unit_of(unit, channel)]
        guess = by_unit if len(by_unit) == 1 else [bases[name] for name in near]
        of_it = f" for {channel}" if len(channels) > 1 else ""
        hints += f" Did you mean {visible(guess[0])}{of_it}?" if guess else ""
    keys = ", ".join(f"rig.columns.{channel} = 'NAME'" for channel in channels)
    advice = f" Name {'them' if len(channels) > 1 else 'it'}: {keys}"
    if "force" in channels:
        advice += "; without a force nothing can be fitted"
    if "displacement" in channels and _candidates("velocity", columns):
        advice += "; a velocity does not stand for it"
    if "time" in channels:
        advice += "; or declare rig.sample_rate, as '500Hz', of rows that are evenly spaced"
    reason = f" ({hint})" if hint else ""
    begin = f"no column for {in_a_row(channels)}{reason}"
    return f"{begin}; there are {_listed(columns)}.{hints}{advice}"
