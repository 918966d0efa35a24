"""What every file says of itself: whose damper, tested where, how good, what is in it and what not.

Plain lines; each target puts its own mark of a comment before them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from damperfit.handover.road import road_errors, road_sentence

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.handover.force_table import ForceTable
    from damperfit.handover.handed_over import HandedOver, Tested

__all__ = ["commented", "gas_line", "provenance_lines"]

_OTHERS = 6  # settings whose MSE is listed one by one


def provenance_lines(
    handed: HandedOver, tables: Sequence[ForceTable], *, sign: str, gas: str
) -> tuple[str, ...]:
    """Return the lines that stand in every file.

    Parameters
    ----------
    handed : HandedOver
        The damper.
    tables : sequence of ForceTable
        What stands in the file.
    sign : str
        What is positive in it, in words.
    gas : str
        Where the gas force is.
    """
    return tuple(_one_line(line) for line in _lines(handed, tables, sign, gas))


def commented(lines: Sequence[str], mark: str) -> str:
    """Return lines as comments, each ended."""
    return "".join(f"{mark} {line}".rstrip() + "\n" for line in lines)


def _lines(handed: HandedOver, tables: Sequence[ForceTable], sign: str, gas: str) -> Iterator[str]:
    settings = ", ".join(str(one.setting) for one in tables)
    yield f"damperfit {handed.version}: {handed.name}, setting {settings}"
    yield "identity: " + ("; ".join(f"{k} {v}" for k, v in handed.identity.items()) or "not named")
    yield f"model: {handed.damper.sentence}"
    yield f"tested: {_tested(handed.tested)}"
    yield f"MSE of the fit: {_mse(tables)}"
    sine = handed.motion
    yield (
        f"table: force of the model on a sine of {1e3 * sine.amplitude:.4g} mm at "
        f"{sine.frequency:.4g} Hz, mean of opening and closing branch"
    )
    yield _extrapolation(tables[0])
    yield "lost in a table: " + road_sentence(road_errors(handed, tables), tables)
    yield f"gas: {gas}"
    yield f"sign: {sign}"
    yield f"results: sha256 {handed.digest or 'not known'}"


def gas_line(table: ForceTable, *, place: str, is_bump_positive: bool = False) -> str:
    """Return what presses at rest, and where it belongs.

    Parameters
    ----------
    table : ForceTable
        Of any setting: the gas is the damper's.
    place : str
        What to do with it: "add it to the spring".
    is_bump_positive : bool
        Whether the file counts forces so; the gas then has the sign of its spring.
    """
    sign, way = (-1.0, "plus") if is_bump_positive else (1.0, "minus")
    what = "gas force" if table.has_gas else "force at rest, gas and tare of the rig together,"
    level = sign * table.level
    sentence = f"not in the table; {what} {level:.4g} N at x = 0 ({way} pushes the rod out)"
    if table.has_gas:
        in_bump, in_rebound = sign * table.gas_forces[0], sign * table.gas_forces[-1]
        sentence += (
            f", {in_bump:.4g} N at -{1e3 * table.stroke:.3g} mm, "
            f"{in_rebound:.4g} N at +{1e3 * table.stroke:.3g} mm of rebound"
        )
    return f"{sentence}; {place}"


def _tested(tested: Tested) -> str:
    known = [f"{tested.n_logs} log{'s' * (tested.n_logs != 1)}"] if tested.n_logs else []
    if tested.stroke is not None:
        known.append(f"stroke to +-{1e3 * tested.stroke:.4g} mm")
    if tested.speed is not None:
        known.append(f"speed to {tested.speed:.4g} m/s")
    for ends, unit in ((tested.frequencies, "Hz"), (tested.temperatures, "degC")):
        if ends is not None:
            low, high = (f"{end:.4g}" for end in ends)
            known.append(f"{low} {unit}" if low == high else f"{low} to {high} {unit}")
    if tested.temperatures is None:
        known.append("temperature not logged")
    return ", ".join(known)


def _mse(tables: Sequence[ForceTable]) -> str:
    known = [one for one in tables if math.isfinite(one.mse_percent)]
    if not known:
        return "not known"
    if len(known) > _OTHERS:
        worst = max(known, key=lambda one: one.mse_percent)
        best = min(known, key=lambda one: one.mse_percent)
        return (
            f"{best.mse_percent:.3g} % (setting {best.setting}) to {worst.mse_percent:.3g} % "
            f"(setting {worst.setting})"
        )
    if len(known) == 1:
        return f"{known[0].mse_percent:.3g} %"
    return ", ".join(f"{one.mse_percent:.3g} % at setting {one.setting}" for one in known)


def _extrapolation(table: ForceTable) -> str:
    if table.is_extended:
        return (
            f"beyond {table.tested_speed:.4g} m/s UNTESTED: up to {table.speeds[-1]:.4g} m/s the "
            "table is the model's, unmeasured there"
        )
    return (
        f"beyond {table.tested_speed:.4g} m/s there is nothing: do not let a program hold the last "
        "value, the damper's force goes on rising; --extend SPEED adds rows of the model"
    )


def _one_line(text: str) -> str:
    """Return text that ends no comment and holds no control characters."""
    return "".join(letter if letter.isprintable() else " " for letter in text)
