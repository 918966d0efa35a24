"""Whether making dampers is under control: Cp and Cpk of each force, and rules over the dates."""

from __future__ import annotations

import math
from datetime import date, timedelta
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from damperfit.fleets.survey import LEAST_SPREAD
from damperfit.reporting.sheet import Column, laid_out, number, with_interval
from damperfit.statistics import NORMAL_95, chi_squared_quantile, median

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from damperfit.fleets.survey import HeldFleet, Survey
    from damperfit.reporting.sheet import Sheet

Rows = list[dict[str, Any]]

LEAST_DAMPERS = 10  # of a force: with fewer the interval of Cp is wider than 0.55 to 1.45 of it
DOMINATES = "measurement dominates"
CAPABILITY_COLUMNS = (
    *("setting", "speed_m_per_s", "stroke", "n_dampers", "mean_N", "low_N", "high_N", "s_N"),
    *("measurement_s_N", "cp", "cp_ci_low", "cp_ci_high", "cpk", "cpk_ci_low", "cpk_ci_high"),
    "note",
)
RULE_COLUMNS = (
    *("shift", "setting", "speed_m_per_s", "stroke", "side", "first_damper", "first_date"),
    *("last_damper", "last_date", "rules"),
)
# Of so many dampers in a row so many lie more than so many sigmas off, on one side.
_RULES = {"1": (1, 1, 3.0), "2": (2, 3, 2.0), "3": (4, 5, 1.0), "4": (8, 8, 0.0)}
_MOVING_RANGE = math.sqrt(2.0) * 0.67449  # median of |a - b| of two normal values of sigma 1


def capability(found: Survey, held: HeldFleet) -> Rows:
    """Return Cp and Cpk of each force that a tolerance covers, the smallest Cpk first.

    s^2 is the variance S^2 of n dampers less the mean square v of their forces' standard errors.
    The interval of Cp is that of S^2 by chi-square of n - 1, less v (no upper end where nothing is
    left). That of Cpk is the normal approximation of Bissell (1990), "How reliable is your
    capability index?", Applied Statistics 39, 331-340, whose variance 1/(9 n) + Cpk^2/(2 (n - 1))
    takes the factors S^2/s^2 and S^4/s^4 here, as S^2 is what scatters. v counts as known.
    """
    series = {one.name: one for one in found.series}
    rows = []
    groups: Any = held.forces.groupby(["series", "setting", "least", "most"])
    for (name, setting, low, high), own in groups:
        # A damper that was tested several times is the mean of its tests.
        tests = own.assign(square=own["error"] ** 2).groupby("damper")
        dampers = tests[["value", "square"]].mean()
        n, noise = len(dampers), float((dampers["square"] / tests.size()).mean())
        if n < LEAST_DAMPERS or math.isnan(noise):
            continue
        mean, total = float(dampers["value"].mean()), float(dampers["value"].var())
        s, indices, note = math.sqrt(max(total - noise, 0.0)), (None,) * 6, DOMINATES
        if s > 0.0:
            ends = []
            for share in (0.025, 0.975):
                left = total * (n - 1) / chi_squared_quantile(n - 1, share) - noise
                ends.append((high - low) / (6.0 * math.sqrt(left)) if left > 0.0 else None)
            cpk, more = min(high - mean, mean - low) / (3.0 * s), total / s**2
            reach = NORMAL_95 * math.sqrt(more / (9 * n) + (cpk * more) ** 2 / (2 * (n - 1)))
            indices = ((high - low) / (6.0 * s), *ends, cpk, cpk - reach, cpk + reach)
            note = ""
        place = (str(found.settings[setting]), series[name].speed, series[name].stroke)
        cells = (*place, n, mean, low, high, s, math.sqrt(noise), *indices, note)
        rows.append(dict(zip(CAPABILITY_COLUMNS, cells, strict=True)))
    return sorted(rows, key=lambda row: math.inf if row["cpk"] is None else row["cpk"])


def capability_sheet(rows: Rows, most: int) -> Sheet:
    """Return Cp and Cpk by force, so many at most."""

    def index(name: str, row: dict[str, Any]) -> str:
        low, high = row[f"{name}_ci_low"], row[f"{name}_ci_high"]
        if row[name] is not None and high is None:
            return f"{row[name]:.2f} (above {low:.2f})"
        return with_interval(row[name], low, high, digits=3)

    columns = [
        Column("set", "", lambda row: row["setting"]),
        Column("speed", "m/s", lambda row: number(row["speed_m_per_s"])),
        Column.text("stroke", "stroke"),
        Column("dampers", "", lambda row: str(row["n_dampers"])),
        *(Column.of(name, "N", f"{name}_N") for name in ("mean", "low", "high")),
        Column.of("s", "N", "s_N", digits=3),
        Column.of("measurement", "N", "measurement_s_N", digits=3),
        Column("Cp", "", partial(index, "cp")),
        Column("Cpk", "", partial(index, "cpk")),
        Column.text("", "note"),
    ]
    note = (
        "s: standard deviation of the dampers, that of the measurement taken out. ± and ranges are "
        "95 % intervals. All forces are in fleet_capability.csv."
    )
    return laid_out(rows[:most], columns, note)


class _Event(NamedTuple):
    """Dampers in a row, by place among all tests, at which one force breaks rules on one side."""

    series: str
    setting: int
    side: str
    first: int
    last: int
    rules: str
    size: float  # sigmas, of the farthest


def run_rules(found: Survey) -> tuple[list[str], Rows]:
    """Return shifts over the dates of the tests in a sentence each, and what each force says.

    The four zone rules of the Western Electric Statistical Quality Control Handbook (1956), by date
    and then serial number, around the median; sigma is the median moving range over 0.954, so that
    neither a shift nor one damper widens it. A steady force breaks one of them once in 92 tests
    (Champ and Woodall 1987, Technometrics 29, 393-399), with median and sigma of 20 dampers once in
    62. What breaks rules at the dampers of the longest event, or beside them, is one shift; that
    with the most forces stands first.
    """
    series = {one.name: one for one in found.series}
    names = [one.damper for one in found.dampers]
    rank = {name: k for k, name in enumerate(names)}
    values: Any = found.values.dropna(subset=["day"])
    values = values[values["series"].isin([one.name for one in found.series if one.stroke])]
    order = zip(values["day"], values["damper"].map(rank), strict=True)
    values = values.assign(test=list(order))
    tests = sorted(set(values["test"]))
    places = {one: k for k, one in enumerate(tests)}
    events, n_forces = [], 0
    by_force: Any = values.groupby(["series", "setting"], sort=False)
    for (name, setting), own in by_force:
        forces = own.groupby("test")["value"].mean()
        if len(forces) < LEAST_DAMPERS or own["day"].nunique() < 2:
            continue
        n_forces += 1
        middle, moves = median(forces), median(np.abs(np.diff(forces)))
        sigma = max(moves / _MOVING_RANGE, LEAST_SPREAD * abs(middle))
        z = (forces.to_numpy() - middle) / (sigma or math.inf)
        at = [places[one] for one in forces.index]
        for side, first, last, rules in _broken(z):
            size = float(np.abs(z[first : last + 1]).max())
            events.append(_Event(name, setting, side, at[first], at[last], rules, size))
    events.sort(key=lambda one: (one.first - one.last, -one.size))
    groups = []
    while events:
        low, high = events[0].first - 1, events[0].last + 1
        groups.append([one for one in events if one.first <= high and one.last >= low])
        events = [one for one in events if one.first > high or one.last < low]
    groups.sort(key=lambda group: -len({one[:2] for one in group}))
    who = [(names[k] or "unknown", str(date(1970, 1, 1) + timedelta(days=day))) for day, k in tests]

    def told(event: _Event) -> str:
        until = " to {} ({})".format(*who[event.last]) if event.last > event.first else ""
        where = "{} ({})".format(*who[event.first]) + until
        return f"{event.side} its median at {where} by rule {event.rules}"

    sentences: list[str] = []
    rows: Rows = []
    for number_of, group in enumerate(groups, start=1):
        main = group[0]
        same = sorted((one for one in group if one[:2] == main[:2]), key=lambda one: one.first)
        sentences.append(
            f"The {series[main.series].label} at setting {found.settings[main.setting]} is "
            f"{', '.join(map(told, same))}; with it {len({one[:2] for one in group})} of "
            f"{n_forces} forces are off."
        )
        for one in group:
            force = series[one.series]
            place = (str(found.settings[one.setting]), force.speed, force.stroke, one.side)
            cells = (number_of, *place, *who[one.first], *who[one.last], one.rules)
            rows.append(dict(zip(RULE_COLUMNS, cells, strict=True)))
    return sentences, rows


def _broken(z: NDArray[np.float64]) -> Iterator[tuple[str, int, int, str]]:
    """Yield side, first and last place, and rules, of each stretch that breaks rules."""
    for side, sign in (("above", 1), ("below", -1)):
        spans: list[tuple[int, int, str]] = []
        for rule, (needed, window, zone) in _RULES.items():
            over = sign * z > zone
            counts = np.convolve(over, np.ones(window))[: len(z)]
            for end in np.flatnonzero(over & (counts > needed - 0.5)).tolist():
                begin = max(0, end - window + 1)
                spans.append((begin + int(np.argmax(over[begin : end + 1])), end, rule))
        merged: list[tuple[int, int, str]] = []
        for first, last, rule in sorted(spans):
            if merged and first <= merged[-1][1] + 1:
                begin, end, broken = merged.pop()
                merged.append((begin, max(end, last), broken + rule))
            else:
                merged.append((first, last, rule))
        for first, last, rules in merged:
            yield side, first, last, ", ".join(sorted(set(rules)))
