r"""Butterworth low-pass filters: design, and how they run over a signal.

A Butterworth filter of order N designed for the corner fc by the bilinear transform has, with
``w(f) = tan(pi f / fs)``, the gain::

    |H(f)|^2 = 1 / (1 + (w(f)/w(fc))^(2N))

- *causal*: one pass. -3 dB at the corner. With N = 4, fc = 30 Hz, fs = 500 Hz a 1.5 Hz sine comes
  13.704 ms late (-7.40 degrees).
- *zero_phase*: one pass forward, one backward. The phase is exactly zero and the gain is |H|^2:
  the order has doubled (a 4th-order filter falls like one of 8th order), and the gain at fc would
  be -6 dB. The two passes are therefore designed for a higher corner fd::

      w(fd) = w(fc) / (sqrt(2) - 1)^(1/(2N))        33.4 Hz for 30 Hz, N = 4

  so that the combined gain is -3 dB at fc.
- *completed*: the forward-backward pair of a filter designed as causal: |H|^2 with -6 dB at fc.
  That is what a rig's ordinary forward-backward filter does, and what a causal filter becomes when
  its time-reversed pass follows.

Edges: before each forward-backward run both ends are continued by odd reflection
(2 s[0] - s[k]), and each pass starts in the steady state of its first value. What an edge does to
the signal dies out with the slowest pole; `settling_samples` says when it is gone.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.conditioning.options import FILTER_KINDS
from damperfit.errors import ConditioningError, ConfigurationError, did_you_mean
from damperfit.recording import FilterDesign

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = [
    "apply_filter",
    "complete_causal",
    "completed",
    "design_filter",
    "fading_samples",
    "gain_at",
    "settling_samples",
]

# An edge left over at 1e-8 of the force moves no parameter by more than 1e-6.
_SETTLED = 1e-8
# Reflected samples ahead of an edge; the start of a pass is forgotten to this share behind them.
_PADDED = 1e-3
# How often a signal is run through, as the compiled core has it.
_FORWARD, _BOTH = 1, 0


def design_filter(
    kind: str,
    corner: float,
    *,
    sample_rate: float,
    order: int = 4,
    key: str = "conditioning.filter_corner",
) -> FilterDesign:
    """Return a Butterworth low-pass of the kind "zero_phase", "causal" or "none".

    Parameters
    ----------
    kind : str
        "zero_phase": forward and backward, combined gain -3 dB at the corner. "causal": forward
        only, -3 dB at the corner. "none": passes everything.
    corner : float
        Frequency of -3 dB, Hz.
    sample_rate : float
        Hz.
    order : int
        Order of one pass.
    key : str
        What the corner is called where a user says it, for the refusal.

    Raises
    ------
    ConfigurationError
        Unknown kind.
    ConditioningError
        The corner is not below half the sample rate.

    Examples
    --------
    >>> design_filter("zero_phase", 30.0, sample_rate=1000.0).description
    'zero-phase Butterworth low-pass, order 4 forward and backward, -3 dB at 30 Hz'
    """
    if kind not in FILTER_KINDS:
        raise ConfigurationError(
            f"filter: unknown kind {kind!r}; expected {', '.join(FILTER_KINDS)}."
            f"{did_you_mean(kind, FILTER_KINDS)}"
        )
    if kind == "none":
        return FilterDesign(np.empty((0, 6)), is_zero_phase=True, description="no filter")
    if not corner < sample_rate / 2.0:
        raise ConditioningError(
            f"the filter corner of {corner:g} Hz is not below half the sample rate "
            f"({sample_rate / 2.0:.4g} Hz at {sample_rate:.4g} samples per second); sample faster, "
            f"set {key} = '{float(f'{0.4 * sample_rate:.2g}'):g}Hz', which fits, or choose the "
            "filter 'none'"
        )
    if kind == "causal":
        text = f"causal Butterworth low-pass, order {order}, -3 dB at {corner:g} Hz"
        return FilterDesign(_sections(order, corner, sample_rate), False, text)
    warped = math.tan(math.pi * corner / sample_rate) / (math.sqrt(2.0) - 1.0) ** (0.5 / order)
    shifted = math.atan(warped) * sample_rate / math.pi
    text = (
        f"zero-phase Butterworth low-pass, order {order} forward and backward, "
        f"-3 dB at {corner:g} Hz"
    )
    return FilterDesign(_sections(order, shifted, sample_rate), True, text)


def completed(design: FilterDesign, corner: float, order: int) -> FilterDesign:
    """Return the forward-backward pair of a causal design: zero phase, -6 dB at its corner."""
    text = (
        f"zero-phase Butterworth low-pass, order {order} forward and backward, "
        f"-6 dB at {corner:g} Hz (each pass -3 dB)"
    )
    return FilterDesign(design.sections, True, text)


def apply_filter(design: FilterDesign, signal: FloatArray, axis: int = -1) -> FloatArray:
    """Return a signal behind a filter.

    Parameters
    ----------
    design : FilterDesign
        From `design_filter` or a trace's ``model_filter``.
    signal : numpy.ndarray
        Any shape, at least two samples along ``axis``.
    axis : int
        Axis of time.

    Returns
    -------
    numpy.ndarray
        Same shape, new memory.
    """
    if not len(design.sections):
        return np.array(signal, dtype=np.float64)
    run = _forward_backward if design.is_zero_phase else _one_pass
    moved = np.asarray(signal, dtype=np.float64)
    if axis != -1:
        moved = np.moveaxis(moved, axis, -1)
    if design.bridged:
        at = np.array(design.bridged)
        moved = moved.copy()
        moved[..., at] = 0.5 * (moved[..., at - 1] + moved[..., at + 1])
    passed = run(design.sections, moved)
    return passed if axis == -1 else np.moveaxis(passed, -1, axis)


def complete_causal(design: FilterDesign, signal: FloatArray) -> FloatArray:
    """Return a causally filtered signal after the time-reversed pass of the same filter.

    The delay of the first pass is corrected exactly: together both are |H|^2 with zero phase.
    """
    n = signal.shape[-1]
    pad = min(int(_constants(design.sections.tobytes())[2]), n - 1)
    behind = 2.0 * signal[..., -1:] - signal[..., -2 : -pad - 2 : -1]
    backward = _one_pass(design.sections, np.concatenate([signal, behind], axis=-1)[..., ::-1])
    return backward[..., ::-1][..., :n].copy()


def gain_at(design: FilterDesign, frequency: float, *, sample_rate: float) -> float:
    """Return the share of a sine's amplitude that passes, both passes counted."""
    z = np.exp(-2j * np.pi * frequency / sample_rate * np.arange(3))
    one_pass = np.prod(np.abs(design.sections[:, :3] @ z) / np.abs(design.sections[:, 3:] @ z))
    return float(one_pass**2 if design.is_zero_phase else one_pass)


def settling_samples(design: FilterDesign) -> int:
    """Return after how many samples an edge is forgotten to 1e-8, from the slowest pole."""
    return int(_constants(design.sections.tobytes())[1])


def fading_samples(design: FilterDesign) -> int:
    """Return after how many samples an edge is forgotten to 1e-3, from the slowest pole."""
    return int(_constants(design.sections.tobytes())[2])


def _sections(order: int, corner: float, sample_rate: float) -> FloatArray:
    return np.array(_designed(order, corner, sample_rate))


@lru_cache(maxsize=64)
def _designed(order: int, corner: float, sample_rate: float) -> tuple[tuple[float, ...], ...]:
    """Pairs of poles by rising resonance, the whole gain in the first section.

    s/w = (z - 1)/(z + 1)/tan(pi fc/fs) takes 1/(s^2 + 2 c s + 1), and 1/(s + 1) of an odd order, to
    the sections below.
    """
    w = math.tan(math.pi * corner / sample_rate)
    rows, gain = [], 1.0
    if order % 2:
        rows.append((1.0, 1.0, 0.0, 1.0, (w - 1.0) / (w + 1.0), 0.0))
        gain *= w / (w + 1.0)
    for k in range(order // 2 - 1, -1, -1):
        damping = 2.0 * math.sin(math.pi * (2 * k + 1) / (2 * order))
        whole = 1.0 + damping * w + w * w
        rows.append(
            (1.0, 2.0, 1.0, 1.0, 2.0 * (w * w - 1.0) / whole, (1.0 - damping * w + w * w) / whole)
        )
        gain *= w * w / whole
    first = rows[0]
    return ((*(gain * b for b in first[:3]), *first[3:]), *rows[1:])


@lru_cache(maxsize=64)
def _constants(sections: bytes) -> tuple[FloatArray, int, int]:
    """Return the steady state of a unit step (k, 2), samples to 1e-8, samples of padding."""
    table = np.frombuffer(sections).reshape(-1, 6)
    if not len(table):
        return np.empty((0, 2)), 0, 0
    slowest = max(float(np.abs(np.roots(row[3:])).max()) for row in table)
    settled, padded = (
        math.ceil(math.log(level) / math.log(slowest)) for level in (_SETTLED, _PADDED)
    )
    return _steady(table), settled, padded


def _steady(sections: FloatArray) -> FloatArray:
    """Return the state of each section, (k, 2), for a constant 1 that goes into the first."""
    states, level = [], 1.0
    for b0, b1, b2, _, a1, a2 in sections.tolist():
        gain = (b0 + b1 + b2) / (1.0 + a1 + a2)
        late = b2 - a2 * gain
        states.append((level * (b1 - a1 * gain + late), level * late))
        level *= gain
    return np.array(states)


def _one_pass(sections: FloatArray, signal: FloatArray) -> FloatArray:
    """Run forward once, from the steady state of the first value."""
    return _run(sections, signal, pad=0, way=_FORWARD)


def _forward_backward(sections: FloatArray, signal: FloatArray) -> FloatArray:
    """Run forward and backward over the signal, both ends continued by odd reflection."""
    pad = min(int(_constants(sections.tobytes())[2]), signal.shape[-1] - 1)
    return _run(sections, signal, pad=pad, way=_BOTH)


def _run(sections: FloatArray, signal: FloatArray, *, pad: int, way: int) -> FloatArray:
    """Same numbers as SciPy's `sosfilt` and `sosfiltfilt`, in less time."""
    rows = np.ascontiguousarray(signal, dtype=np.float64)
    n = rows.shape[-1]
    result = np.empty_like(rows)
    steady = _constants(sections.tobytes())[0]
    compiled_core().run_filter(
        np.ascontiguousarray(sections), steady, rows, result, np.empty(2 * (n + 2 * pad)),
        rows.size // n, pad, way,
    )  # fmt: skip
    return result
