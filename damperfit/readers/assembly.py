"""Table to Recording: channels in SI with the project's signs, checked, and the setting."""

from __future__ import annotations

import re
from pathlib import PurePath
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import LogError
from damperfit.readers.channels import choose_channels, visible
from damperfit.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from damperfit.readers.channels import ChannelChoice
    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions
    from damperfit.readers.table import Table

    FloatArray = NDArray[np.float64]

__all__ = ["make_recording"]

_MAX_SETTING = 1_000_000  # a label; anything longer is a date or a serial number


def make_recording(table: Table, source: Source, options: ReadOptions) -> Recording:
    """Return a table's channels in SI.

    Raises
    ------
    LogError
        A channel or unit is missing, a value is no finite number, time does not increase, or
        the setting is no whole number.
    """
    name = f"{source.name} {table.part}".strip()
    choices, notes = choose_channels(table.columns, options, where=name)
    raw = table.load({channel: choice.index for channel, choice in choices.items()})
    if not len(raw["time"]):
        raise LogError(f"{name}: no data rows")
    channels = {}
    for channel in ("time", "displacement", "force"):
        _check_finite(raw[channel], channel, table, name)
        channels[channel] = _si(raw[channel], choices[channel])
        # A factor may overflow what the log's own unit could hold.
        _check_finite(channels[channel], channel, table, name)
    _check_time(channels["time"], table, name)
    temperature, temperature_note = _temperature(raw, choices)
    setting, setting_note = _setting(raw, table, source, options, name)
    signs, sign_notes = _signs(options)
    return Recording(
        name=name,
        path=source.path,
        sha256=source.sha256,
        setting=setting,
        time=channels["time"],
        displacement=channels["displacement"] * signs[0],
        force=channels["force"] * signs[1],
        temperature=temperature,
        notes=(*table.notes, *notes, *sign_notes, *temperature_note, *setting_note),
        metadata=table.metadata,
    )


def _si(values: FloatArray, choice: ChannelChoice) -> FloatArray:
    assert choice.unit is not None
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(choice.unit.to_si(values), dtype=np.float64)


def _check_finite(values: FloatArray, channel: str, table: Table, name: str) -> None:
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise LogError(
            f"{name}, {table.place(int(bad[0]))}: {channel} is blank, NaN or infinite, in "
            f"{len(bad)} of {len(values)} rows in all; repair the log or remove these rows"
        )


def _check_time(time: FloatArray, table: Table, name: str) -> None:
    late = np.flatnonzero(np.diff(time) <= 0.0)
    if len(late):
        i = int(late[0]) + 1
        what = "repeats" if time[i] == time[i - 1] else "runs backwards"
        raise LogError(
            f"{name}, {table.place(i)}: time {what}: {time[i]:.9g} s after {time[i - 1]:.9g} s; "
            f"time must increase ({len(late)} such rows)"
        )


def _temperature(
    raw: Mapping[str, FloatArray], choices: Mapping[str, ChannelChoice]
) -> tuple[FloatArray | None, tuple[str, ...]]:
    if "temperature" not in choices:
        return None, ()
    values = _si(raw["temperature"], choices["temperature"])
    n_bad = int(np.count_nonzero(~np.isfinite(values)))
    if n_bad:
        return None, (f"temperature: left out; {n_bad} of {len(values)} values are missing",)
    return values, ()


def _signs(options: ReadOptions) -> tuple[tuple[float, float], tuple[str, ...]]:
    notes = []
    if options.reverse_displacement:
        notes.append("displacement: sign reversed, as declared")
    if options.reverse_force:
        notes.append("force: sign reversed, as declared")
    signs = (
        -1.0 if options.reverse_displacement else 1.0,
        -1.0 if options.reverse_force else 1.0,
    )
    return signs, tuple(notes)


def _setting(
    raw: Mapping[str, FloatArray], table: Table, source: Source, options: ReadOptions, name: str
) -> tuple[int | None, tuple[str, ...]]:
    """Return the setting from the declaration, the preamble, a column or the file name."""
    if options.setting is not None:
        return options.setting, ("setting: as declared",)
    if "setting" in table.metadata:
        return _whole(table.metadata["setting"], f"{name}: metadata 'setting'"), ()
    if "setting" in raw:
        values = raw["setting"]
        _check_finite(values, "setting", table, name)
        change = np.flatnonzero(values != values[0])
        if len(change):
            i = int(change[0])
            raise LogError(
                f"{name}, {table.place(i)}: setting changes from {values[0]:g} to {values[i]:g}; "
                "one test has one setting"
            )
        return _whole(f"{values[0]:.15g}", f"{name}: column 'setting'"), ()
    found = re.findall(f"(?i:{options.setting_pattern})", PurePath(source.name).name)
    if not found:
        return None, ()
    last = found[-1] if isinstance(found[-1], str) else found[-1][0]
    return _whole(last, f"{name}: file name"), ("setting: from the file name",)


def _whole(text: str, where: str) -> int:
    found = re.fullmatch(r"\s*(\d{1,9})(?:\.0*)?\s*", text)
    if found is None or int(found[1]) > _MAX_SETTING:
        raise LogError(
            f"{where}: setting {visible(text)}; expected a whole number from 0 to {_MAX_SETTING}"
        )
    return int(found[1])
