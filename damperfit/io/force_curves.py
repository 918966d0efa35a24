"""Curves without time: speed and force as points (PVP) or loops (CVP), by stroke and setting.

Columns say which is which: a speed, a force, or the force of a stroke (`Rebound`, `C`, `R`), each
stroke with a speed of its own or all with one; `(25-4.3) V-C, C, V-R, R` begins the columns of a
setting that the maker calls 25-4.3. A column `setting` or `click` divides the rows.

Traps. Makers write bump as positive numbers. Points that were not measured are blank cells. A speed
without a sign leaves the stroke to the force's sign.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from damperfit.errors import LogError
from damperfit.io.columns import (
    WORDS,
    channel_choice,
    has_channel,
    joined_problems,
    split_name,
    visible,
    words_of_name,
)
from damperfit.io.files import Source
from damperfit.io.formats import Column, FloatArray, Table
from damperfit.io.options import ReadOptions
from damperfit.problem import Option
from damperfit.statistics import median
from damperfit.units.quantities import Unit, is_unit

_STROKES = {
    "rebound": {"rebound", "reb", "r", "extension", "ext", "zug", "détente", "estensione"},
    "bump": {"bump", "compression", "comp", "c", "jounce", "druck", "kompression", "compressione"},
}
_SPEED, _FORCE = {*WORDS["velocity"]}, {*WORDS["force"], "pvp", "peak"}
_SETTING = {
    "setting", "click", "clicks", "detent", "notch", "klick", "klicks", "raste", "stufe", "clic",
    "clics", "cran", "crans",
}  # fmt: skip
_LABEL = re.compile(r"\s*\((?P<label>[^()]{1,40})\)\s*(?P<rest>\S.*)", re.DOTALL)
_NUMBERED = re.compile(r"\.\d+$")  # "C.1": a name that some tools give to the second "C"
_WORD = re.compile(r"[^\W\d_]+")
_LOOP = 50  # points of a stroke; fewer are points in any order
_MAX_CURVES = 500
_STIFFER = 1.1  # times the other stroke's force; below, the two are alike


@dataclass(frozen=True, slots=True, eq=False)
class ForceCurve:
    """Force over speed as measured, without time."""

    name: str  # of its file
    path: str  # as given
    sha256: str  # of the file's bytes
    label: str  # what the file calls the setting or curve, else the file's name
    velocity: FloatArray  # shape (n,), m/s, positive in rebound, in the order of the file
    force: FloatArray  # likewise, N
    notes: tuple[str, ...] = ()  # what was assumed

    def points(self, stroke: str) -> tuple[FloatArray, FloatArray]:
        """Return the speeds (positive) and forces of "rebound" or "bump", in the file's order."""
        sign = -1.0 if stroke == "bump" else 1.0
        is_in = sign * self.velocity > 0.0
        return np.abs(self.velocity[is_in]), self.force[is_in]

    def force_at(self, speed: float, stroke: str) -> float:
        """Return the force between measured speeds, N; NaN beyond them. Of a loop the mean."""
        return float(np.mean(self._at(speed, stroke)))

    def hysteresis_at(self, speed: float, stroke: str) -> float:
        """Return the opening less the closing force of a loop, N; NaN of points."""
        opening, *closing = self._at(speed, stroke)
        return opening - closing[0] if closing else np.nan

    def _at(self, speed: float, stroke: str) -> list[float]:
        """Return the force of the points, or of the opening and the closing branch of a loop."""
        speeds, forces = self.points(stroke)
        if len(speeds) >= _LOOP:
            is_rising = np.gradient(speeds) >= 0.0
            sides = (is_rising, ~is_rising)
            if min(map(np.count_nonzero, sides)) > _LOOP // 10:
                return [_between(speeds[side], forces[side], speed) for side in sides]
        return [_between(speeds, forces, speed)]

    def describe(self) -> dict[str, Any]:
        """Return the curve as JSON values."""
        return {
            "label": self.label,
            "velocity_m_per_s": self.velocity.tolist(),
            "force_N": self.force.tolist(),
            "notes": list(self.notes),
        }


def _between(speeds: FloatArray, forces: FloatArray, speed: float) -> float:
    """Return the force at a speed, on straight lines between points; equal speeds are averaged."""
    if not len(speeds):
        return np.nan
    distinct, place = np.unique(speeds, return_inverse=True)
    means = np.bincount(place, forces) / np.bincount(place)
    return float(np.interp(speed, distinct, means, left=np.nan, right=np.nan))


class _Heading(NamedTuple):
    """Label, stroke and kind of a column, by its name."""

    label: str
    stroke: str  # "rebound", "bump" or empty
    kind: str  # "speed", "force", "setting" or empty


class _Pair(NamedTuple):
    """Columns of speed and force that belong together."""

    label: str
    stroke: str  # empty: by the signs
    speed: int
    force: int


def holds_curves(tables: Sequence[Table], options: ReadOptions) -> bool:
    """Say whether tables have speed and force, but no time to go with them."""
    return (
        bool(tables)
        and options.sample_rate == 0.0
        and not any(has_channel("time", table.columns, options) for table in tables)
        and all(_pairs(table.columns, _headings(table.columns, options)) for table in tables)
    )


def make_curves(
    source: Source, tables: Sequence[Table], options: ReadOptions, notes: tuple[str, ...]
) -> tuple[ForceCurve, ...]:
    """Return the curves in a file's tables, in SI, positive in rebound."""
    if any(has_channel("time", table.columns, options) for table in tables):
        raise LogError(
            "has a time column, so it is a log, not a curve; fit it by damperfit identify "
            f"{source.name}",
            code="not-a-curve",
        )
    curves = [curve for table in tables for curve in _table_curves(table, source, options, notes)]
    if len(curves) > _MAX_CURVES:
        text = f"{len(curves)} curves, more than the limit of {_MAX_CURVES}"
        raise LogError(text, code="too-large")
    if not curves:
        raise LogError("no speed with a force beside it", code="no-data")
    return tuple(curves)


def _headings(columns: Sequence[Column], options: ReadOptions) -> list[_Heading]:
    """Return label, stroke and kind of each column: as declared, else by name."""
    headings = []
    for i, column in enumerate(columns):
        label, bare = _parted(column.name)
        base, unit = _split(bare)
        words, unit = set(words_of_name(base)), column.unit or unit
        stroke = next((name for name, synonyms in _STROKES.items() if words & synonyms), "")
        kind = "force" if words & _FORCE or stroke or is_unit(unit, "force") else ""
        if words & _SPEED or is_unit(unit, "velocity"):
            kind = "speed"
        if len(words) == 1 and words <= _SETTING:
            stroke, kind = "", "setting"
        for channel in ("velocity", "force", "setting"):
            declared = options.columns.get(channel, "")
            if declared != "" and declared in (i + 1, column.name):
                kind = "speed" if channel == "velocity" else channel
        headings.append(_Heading(label, stroke, kind))
    return headings


def _parted(name: str) -> tuple[str, str]:
    """Return the label in front of a name, and the name."""
    match = _LABEL.fullmatch(name)
    label, base = (match["label"].strip(), match["rest"]) if match else ("", name)
    return label, _NUMBERED.sub("", base)


def _split(name: str) -> tuple[str, str | None]:
    """Return name and unit; the C of "4 clicks C" is a stroke, and no degree."""
    base, unit = split_name(name)
    return (base, unit) if is_unit(unit, "velocity") or is_unit(unit, "force") else (name, None)


def _pairs(columns: Sequence[Column], headings: Sequence[_Heading]) -> list[_Pair]:
    """Return which force goes with which speed, from the left to the right."""
    pairs: list[_Pair] = []
    speeds: dict[str, int] = {}  # by stroke
    label = ""
    for i, heading in enumerate(headings):
        if heading.label and heading.label != label:
            label = heading.label
            speeds = {"": speeds[""]} if "" in speeds else {}
        speed = speeds.get(heading.stroke, speeds.get(""))
        if heading.kind == "speed":
            speeds[heading.stroke] = i
        elif heading.kind == "force" and speed is not None:
            pairs.append(_Pair(label, heading.stroke, speed, i))
    # Pairs without a label are distinguished by the forces' names: where one speed has several
    # forces, or where a stroke is there twice, as in "0 clicks R" and "4 clicks R".
    bare = Counter(pair.stroke for pair in pairs if not pair.label)
    is_doubled = any(n > 1 for stroke, n in bare.items() if stroke)
    words = set.union(*_STROKES.values(), _FORCE)
    numbers: Counter[str] = Counter()
    labelled = []
    for pair in pairs:
        name, label = columns[pair.force].name, pair.label
        if not pair.label and not pair.stroke and bare[""] > 1:
            label = split_name(name)[0]
        elif not pair.label and pair.stroke and is_doubled:
            numbers[pair.stroke] += 1
            base = _split(_parted(name)[1])[0]
            text = _WORD.sub(lambda word: "" if word[0].casefold() in words else word[0], base)
            remainder = " ".join(text.replace("_", " ").split()).strip(" -,;:/()")
            label = remainder or f"curve {numbers[pair.stroke]}"
        labelled.append(pair._replace(label=label))
    return labelled


def _table_curves(
    table: Table, source: Source, options: ReadOptions, notes: tuple[str, ...]
) -> list[ForceCurve]:
    columns = table.columns
    headings = _headings(columns, options)
    pairs = _pairs(columns, headings)
    units = _units(pairs, columns, options)
    if not units:
        return []
    keys = {i: f"column {i + 1}, {visible(columns[i].name)}" for i in sorted(units)}
    indices = {key: i for i, key in keys.items()}
    if setting := [i for i, heading in enumerate(headings) if heading.kind == "setting"]:
        indices["setting"] = setting[0]
    samples = table.load(indices)
    values = {i: units[i].to_si(samples.channels[key]) for i, key in keys.items()}
    rows = {"": np.ones(len(values[pairs[0].speed]), dtype=np.bool_)}
    if setting:
        settings = samples.channels["setting"]
        rows = {f"{value:.15g}": settings == value for value in dict.fromkeys(settings.tolist())}
    points: dict[str, list[tuple[FloatArray, FloatArray, str]]] = {}
    for place, is_in in rows.items():
        for pair in pairs:
            speed, force = values[pair.speed][is_in], values[pair.force][is_in]
            alone = np.flatnonzero(np.isnan(speed) & ~np.isnan(force))
            if len(alone):
                at = samples.place(int(np.flatnonzero(is_in)[alone[0]]))
                text = f"{keys[pair.force]}: a force without a speed"
                raise LogError(text, subject=f", {at}", code="bad-row")
            is_there = ~np.isnan(force)
            label = " ".join(text for text in (pair.label, place) if text)
            signed = _signed(pair.stroke, speed[is_there], force[is_there], options)
            points.setdefault(label, []).append(signed)
    curves = []
    for label, pieces in points.items():
        velocity, force = (np.concatenate([piece[k] for piece in pieces]) for k in (0, 1))
        if not np.isfinite(force).all() or not np.isfinite(velocity).all():
            raise LogError(f"a speed or force {label} is infinite", code="bad-row")
        if not len(force):
            curve = visible(label) if label else "the curve"
            raise LogError(f"no points of {curve}", code="no-data")
        title = label or table.metadata.get("setting") or source.name
        every_note = (*notes, *table.notes, *dict.fromkeys(note for *_, note in pieces if note))
        file = (source.name, source.path, source.sha256)
        curves.append(ForceCurve(*file, title, velocity, force, every_note))
    return curves


def _units(
    pairs: Sequence[_Pair], columns: Sequence[Column], options: ReadOptions
) -> dict[int, Unit]:
    """Return the unit of each column; problems of speeds and forces are in one error."""
    kinds = {pair.speed: "velocity" for pair in pairs} | {pair.force: "force" for pair in pairs}
    units: dict[int, Unit] = {}
    problems: dict[str, LogError] = {}
    for i, kind in kinds.items():
        column = columns[i]._replace(name=_parted(columns[i].name)[1])
        try:
            unit = channel_choice(kind, i, column, options).unit
            if unit is None:
                name = visible(column.name) if column.name else f"number {i + 1}"
                raise LogError(  # noqa: TRY301  # as for a force
                    f"column {name} has no unit of {kind}; write it into the name or declare it in "
                    "rig.units ({declared})",
                    declared=Option("rig", "m/s", f"units.{kind}"),
                    code="no-unit",
                )
            units[i] = unit
        except LogError as error:
            problems.setdefault(kind, error)
    if problems:
        raise joined_problems(list(problems.values()))
    return units


def _signed(
    stroke: str, speed: FloatArray, force: FloatArray, options: ReadOptions
) -> tuple[FloatArray, FloatArray, str]:
    """Return speed and force with the project's signs, and a note."""
    if stroke:
        sign = -1.0 if stroke == "bump" else 1.0
        is_turned = bool(len(force)) and sign * median(force) < 0.0
        note = f"{stroke}: forces reversed, as they are of the other sign" if is_turned else ""
        return sign * np.abs(speed), -force if is_turned else force, note
    speed = -speed if options.reverse_displacement is True else speed
    force = -force if options.reverse_force is True else force
    if not speed.min(initial=0.0) < 0.0 < speed.max(initial=0.0):
        if force.min(initial=0.0) < 0.0 < force.max(initial=0.0):
            note = "rebound: where forces are positive, as logged"
            return np.copysign(speed, force), force, note
        text = (
            "all speeds and forces are of one sign, which leaves open which is rebound; name "
            "the column of the force rebound or bump"
        )
        raise LogError(text, code="unclear-sign")
    if float(np.mean(speed * force)) < 0.0:
        text = (
            "forces are positive where speeds are negative; declare which counts "
            "positive in compression: rig.reverse_force or rig.reverse_displacement = true"
        )
        raise LogError(text, code="unclear-sign")
    note = "rebound: where speeds are positive, as logged"
    sides = [(np.abs(speed[side]), np.abs(force[side])) for side in (speed > 0.0, speed < 0.0)]
    (rebound, _), (bump, _) = sides
    shared = rebound[(rebound >= bump.min()) & (rebound <= bump.max())]
    forces = [[_between(*side, float(v)) for v in shared] for side in sides]
    if len(shared) > 1 and np.all(_STIFFER * np.array(forces[0]) < np.array(forces[1])):
        note += (
            ", although the other side is the stiffer one at every speed, which on most dampers "
            "is rebound; if compression is positive, declare rig.reverse_force and "
            "rig.reverse_displacement = true"
        )
    return speed, force, note
