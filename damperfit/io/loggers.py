"""What loggers do to channels, found from the record alone and put right, with a finding.

A counter of k bits that rolls over jumps by 2^k of its steps while the motion is smooth. A channel
that is slower than the rows is blank between its values: each is used once, at the rows in which
the force has one of its own, and what is sampled at other rows is interpolated to them. Where a
converter's last value is repeated, nothing tells when it was taken: that is a warning.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from damperfit.io.formats import FloatArray, Samples
from damperfit.io.options import EXTRAS
from damperfit.recording import Finding
from damperfit.statistics import median

__all__ = ["mended", "rate_of_stamps"]

_CLOCK_BITS = (16, 24, 32)
_BITS = (10, 12, 14, 16, 18, 20, 24, 32)  # of encoders and converters
_ROLLED = 0.75  # of the range: a step as large is a jump, or nothing rolls over
_SMOOTH = 0.25  # of the range: no step is larger once the jumps are taken out
_LATE = 3.0  # usual steps; where more are missing, a clock may have been set
_FEWEST = 50  # rows
_BLANK = 0.25  # of a channel's rows; fewer blanks are damage
_LONGEST = 20  # rows between two values; a longer blank is a hole
_REPEATED = 0.95  # of runs of one value that have one length


def mended(samples: Samples) -> Samples:
    """Return samples with counters unrolled and each channel on the force's own rows."""
    with np.errstate(over="ignore", invalid="ignore"):  # what is no number is refused later
        return _mended(samples)


def _mended(samples: Samples) -> Samples:
    channels = dict(samples.channels)
    findings = [*samples.findings]
    time = channels.get("time", np.arange(len(channels["force"]), dtype=np.float64))
    if len(time) < _FEWEST:
        return samples
    if "time" in channels and (bits := _clock_bits(time)):
        jumps = np.concatenate(([0.0], np.cumsum(np.diff(time) < 0.0)))
        channels["time"] = time = time + jumps * 2.0**bits
        findings.append(_rolled("time", bits, int(jumps[-1]), "a clock"))
    for channel in ("displacement", "force"):
        if period := _period(channels[channel]):
            bits, quantum = period
            unrolled = np.unwrap(channels[channel], period=quantum * 2.0**bits)
            n_jumps = np.count_nonzero(np.abs(np.diff(channels[channel] - unrolled)) > quantum)
            channels[channel] = unrolled
            findings.append(_rolled(channel, bits, int(n_jumps), "a counter"))
    for channel in ("displacement", "force"):
        if n_rows := _repeats(channels[channel]):
            words = (
                f"{channel}: each value stands in {n_rows} rows, so its converter is slower than "
                f"the rows and friction and openings are doubtful; log at the converter's rate"
            )
            findings.append(Finding("values_repeated", "warning", words, float(n_rows)))
    measured = [name for name in ("displacement", "force", *EXTRAS) if name in channels]
    own = {name: _own_rows(channels[name]) for name in measured}
    slower = {name: rows for name, rows in own.items() if rows is not None}
    if not slower or not np.all(np.diff(time) > 0.0):
        return replace(samples, channels=channels, findings=tuple(findings))
    kept = slower.get("force", np.ones(len(time), dtype=np.bool_))
    for rows in (rows for name, rows in slower.items() if name not in EXTRAS):
        first, last = np.flatnonzero(rows)[[0, -1]]
        kept = kept & (time >= time[first]) & (time <= time[last])
    whole = channels
    channels = {name: values[kept] for name, values in whole.items()}
    for name, rows in slower.items():
        channels[name] = np.interp(time[kept], time[rows], whole[name][rows])
        findings.append(
            Finding(
                "own_rows",
                "note",
                f"{name}: a value of its own in {np.count_nonzero(rows)} of {len(rows)} rows; "
                f"each is used once, at the rows of the force",
                float(np.count_nonzero(rows) / len(rows)),
                is_correction=True,
            )
        )
    at = np.flatnonzero(kept)
    return replace(
        samples,
        channels=channels,
        place=lambda i: samples.place(int(at[i])),
        findings=tuple(findings),
    )


def _rolled(channel: str, bits: int, n_jumps: int, what: str) -> Finding:
    times = "once" if n_jumps == 1 else f"{n_jumps} times"
    sentence = f"{channel}: {what} of {bits} bits rolls over {times}; put right"
    return Finding("rolled_over", "note", sentence, float(n_jumps), is_correction=True)


def _clock_bits(time: FloatArray) -> int:
    """Return the bits of a clock that counts whole ticks and rolls over; 0 of any other."""
    steps = np.diff(time)
    if not np.min(steps) < 0.0:
        return 0
    back, usual = steps[steps < 0.0], median(steps[steps > 0.0]) if np.any(steps > 0.0) else 0.0
    for bits in _CLOCK_BITS:
        mended_steps = back + 2.0**bits
        is_whole = np.max(time) < 2.0**bits and bool(np.all(time == np.rint(time)))
        if is_whole and mended_steps.min() > 0.0 and mended_steps.max() <= _LATE * usual:
            return bits
    return 0


def _period(values: FloatArray) -> tuple[int, float] | None:
    """Return bits and quantum of a counter that rolls over in a channel; None of any other."""
    steps = np.diff(values)
    span = float(np.max(values) - np.min(values))
    if not max(float(np.max(steps)), -float(np.min(steps))) > _ROLLED * span:  # nor of blanks
        return None
    sizes = np.abs(steps)
    quantum = float(f"{np.min(sizes[sizes > 0.0]):.9g}")
    bits = math.ceil(math.log2(span / quantum))
    period = quantum * 2.0**bits
    if bits not in _BITS or _ROLLED * period > span:
        return None
    rest = np.abs(np.diff(np.unwrap(values, period=period)))
    return (bits, quantum) if float(np.max(rest)) < _SMOOTH * period else None


def _own_rows(values: FloatArray) -> NDArray[np.bool_] | None:
    """Return the rows in which a slow channel has a value of its own; None where all rows do."""
    if np.isfinite(values.sum()):
        return None
    is_own = ~np.isnan(values)
    at = np.flatnonzero(is_own)
    is_slow = 2 <= len(at) <= (1.0 - _BLANK) * len(values)
    return is_own if is_slow and int(np.max(np.diff(at))) <= _LONGEST else None


def _repeats(values: FloatArray) -> int:
    """Return how many rows each value stands in where a converter is slower than the rows; or 0."""
    is_new = values[1:] != values[:-1]
    if 2 * np.count_nonzero(is_new) > len(values):
        return 0
    starts = np.flatnonzero(np.concatenate(([True], is_new)))
    runs = np.diff(starts)
    usual = int(median(runs)) if len(runs) else 0
    is_held = 2 <= usual <= _LONGEST and float(np.mean(runs % usual == 0)) >= _REPEATED
    return usual if is_held else 0


def rate_of_stamps(time: FloatArray) -> str:
    """Return the rows a second where several rows share a stamp, in as few digits as it is known.

    Empty where stamps do not only repeat.
    """
    steps = np.diff(time)
    ahead = steps[steps > 0.0]
    if not len(ahead) or float(np.min(steps)) < 0.0 or len(ahead) > 0.9 * len(steps):
        return ""
    span = float(time[-1] - time[0])
    rate, doubt = len(steps) / span, 2.0 * float(np.min(ahead)) / span
    texts = (f"{rate:.{digits}g}" for digits in range(1, 8))
    return next((f"{float(text):g}" for text in texts if abs(float(text) / rate - 1) <= doubt), "")
