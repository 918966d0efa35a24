"""The force level of a steady test: what the gas, or a tare, adds to the force at no speed.

At rest the force is -a_r (P_0 - P_amb). In a test it is hidden under friction, valves and the
elasticity of the oil. Two estimates that err in opposite ways are taken, both odd under a change of
signs:

- *branches*: the constant of a least-squares fit of ``1, x, sgn(v)`` and of v and v^2 in each
  stroke, the closed form of the incompressible damper without its bounds;
- *reversals*: the mean of the force at the two ends of the stroke, where friction and hysteresis
  are opposite, less the curvature of the gas spring.

Their mean is the level. Its uncertainty is half their distance, a share of the hysteresis at the
ends of the stroke, and a little of the gas force. Over the reference set (4 N of noise, 500 Hz) the
level is -130.5 to -134.3 N for -130.4 N; oil so soft that the strokes run into each other spoils
it, and so does cavitation. `python -m tests.conditioning.corrections_grid` prints all cases.

``rebound_curvature`` and ``bump_curvature`` are the part of the force that grows with v^2 at peak
speed, over half the range of the force, positive when the stroke is progressive. The model's
valves make both positive and rebound's larger: a_p1^3 against a_r^3 through valve 1. Those of a
magneto-rheological damper are negative.

A damper that holds its force down to low speed hardly shows a level: preloads that are unlike in
both strokes, behind a filter, move both estimates alike, by up to half their difference. What
turns faster than the filter shows, beyond a friction, says how large they may be.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.passed_speeds import in_both_strokes
from damperfit.statistics import mean_of, median

if TYPE_CHECKING:
    from damperfit.conditioning.options import GasFacts
    from damperfit.conditioning.signals import BoolArray, FloatArray, IntArray
    from damperfit.recording import Trace


# Whether a damper yields before it slides, as magneto-rheological ones and dry friction do.
#
# A valve's force goes with its flow: while the piston slows down it falls with the speed. What
# yields holds its force down to no speed, gives elastically behind the reversal, and slides
# again. So the force that is left at a tenth of the peak speed *while slowing down* is looked at,
# of both strokes together, over the force's range: a tare, the gas and elasticity in series drop
# out.

# Share of the force's range from which it yields. Linear valves keep a tenth and friction adds its
# own share: 0.05 to 0.17 over the reference set. Magneto-rheological logs with current have 0.59 to
# 0.71, synthetic preloaded valves with a small bleed 0.43 to 0.79.
YIELDS = 0.4
_SLOW = 0.1  # of the stretch's peak speed


def held_share(trace: Trace) -> float:
    """Return the share of the measured force's range that is left at a tenth of the speed."""
    return held_shares(trace, trace.force[trace.compared][None, :])[0]


def held_shares(trace: Trace, forces: FloatArray) -> tuple[float, ...]:
    """Return the `held_share` of forces, (k, n), at the compared samples: of stretches the median.

    NaN where none passes that speed both ways.
    """
    shares = []
    for one, place in zip(trace.stretches, trace.places, strict=True):
        v, part = trace.velocity[one.window], forces[:, place]
        slow = (_SLOW * float(max(v.max(), -v.min())),)
        out, into = in_both_strokes(v, part, slow)[1][:, 1, 0]
        shares.append((out - into) / np.maximum(np.ptp(part, axis=1), 1e-300))
    return tuple(
        median([x for x in of if math.isfinite(x)]) for of in np.transpose(shares).tolist()
    )


_MADE_UP = 1e-15  # of the largest of a matrix
# What both estimates may be wrong by together. Oil at 1e8 Pa exceeds it at setting 10
# (`python -m tests.conditioning.corrections_grid`).
_OF_HYSTERESIS = 0.25
_OF_GAS = 0.03
# Of half the range of the force. What opens at low speed and is unlike in both strokes looks like a
# level, in both estimates alike: a share of the digressive curvature. So does what a filter takes
# off the turns: a share for each harmonic that it passes fewer than these. Of synthetic digressive
# and linear strokes at 1 to 12 Hz behind 30 Hz none is called tared that is not
# (`tests/conditioning/test_findings.py`).
_OF_DIGRESSION = 0.1
_OF_HARMONICS = 0.15
_ENOUGH_HARMONICS = 20.0
# Preloads that are unlike in both strokes. What the force jumps by at a turn, within `_TURN` of the
# filter's period, is friction, up to `_OF_FRICTION` of half the range, and preloads; of these
# `_OF_PRELOADS` may look like a level. Of right logs with preloads of 10 to 1000 N in either stroke
# 7 % are reported as tared, 26 % without this; of tared ones 44 %, 64 % without
# (`python -m tests.conditioning.unlike_preloads --tares --dampers 400`, and with `--without`).
_TURN = 0.1
_WIDEST_TURN = 0.5  # of the highest speed
_OF_FRICTION = 0.05
_OF_PRELOADS = 0.7


class ForceLevel(NamedTuple):
    """The level of the force and the curvature of its strokes."""

    branches: float  # the two estimates of the force at x = 0 and no speed, N
    reversals: float
    uncertainty: float  # N; about two standard errors of their mean
    expected: float  # what the gas gives against the air, -a_r (P_0 - P_amb), N
    # Share of the force's half range that grows with v^2, positive when progressive.
    rebound_curvature: float
    bump_curvature: float
    # N; how much of a level may be valves that open early, or what a filter took off the turns.
    hidden: float = 0.0
    # N; how much of a level may be preloads that are unlike in both strokes.
    preloads: float = 0.0
    # N; half the force that the log holds down to low speed, where it yields: all of it may be one
    # stroke's, and a filter that spreads the turn makes a level of it.
    held: float = 0.0

    @property
    def force(self) -> float:
        """The level, mean of both estimates, N."""
        return 0.5 * (self.branches + self.reversals)

    @property
    def doubt(self) -> float:
        """By how much the level may be wrong, with all that may hide in it, N."""
        return self.uncertainty + max(self.hidden, self.preloads) + self.held

    @property
    def ratio(self) -> float:
        """Level over what the gas gives: 1 as expected, 0 tared or no gas, -1 counted reversed."""
        return self.force / self.expected if self.expected else 0.0

    def between(self, unsure: float) -> str:
        """The level beside the gas force, for people."""
        return (
            f"at zero velocity the force is {self.force - unsure:.0f} to "
            f"{self.force + unsure:.0f} N; the gas force alone is {self.expected:.0f} N"
        )


def gas_force(gas: GasFacts, displacement: FloatArray) -> FloatArray:
    """Return a_r (P_amb - P_0 (V_g0/(V_g0 + a_r x))^gamma), N; x in m; eq. (17) corrected."""
    room = np.maximum(gas.volume + gas.rod_area * displacement, 1e-3 * gas.volume)
    pressure = gas.pressure * (gas.volume / room) ** gas.exponent
    return np.asarray(gas.rod_area * (gas.ambient - pressure))


def force_level(trace: Trace, gas: GasFacts, *, corner: float = math.inf) -> ForceLevel:
    """Return the force level of what is compared of a trace, behind a filter of this corner, Hz."""
    whole = _level_of(trace, gas, corner)
    if len(trace.stretches) < 2:
        return whole
    # The motion that hides it least tells the level: valves that open below a tenth of the highest
    # speed look like a level there. The curvature is that of all of them.
    alone = (replace(trace, stretches=(one,)) for one in trace.stretches)
    clearest = min((_level_of(one, gas, corner) for one in alone), key=lambda level: level.doubt)
    return clearest._replace(
        rebound_curvature=whole.rebound_curvature,
        bump_curvature=whole.bump_curvature,
    )


def _level_of(trace: Trace, gas: GasFacts, corner: float) -> ForceLevel:
    channels = trace.displacement, trace.velocity, trace.force
    x, v, f = (channel[trace.compared] for channel in channels)
    half_range = max(0.5 * float(np.ptp(f)), 1e-300)
    constant, rebound, bump = _branches(x, v, f)
    # Force and displacement at the ends of rebound and of bump.
    before, part, is_out = reversals(v)
    (force_out, force_in), (x_out, x_in) = (
        [mean_of(at[is_end]) for is_end in (is_out, ~is_out)]
        for at in (y[before] + part * (y[before + 1] - y[before]) for y in (f, x))
    )
    hysteresis = 0.5 * abs(force_out - force_in)
    curved = mean_of(gas_force(gas, np.array([x_out, x_in]))) + gas.force
    at_reversals = float(np.mean([force_out, force_in])) - curved
    sizes = np.array([one.n_samples for one in trace.stretches], dtype=np.float64)
    rates = np.array([one.frequency for one in trace.stretches])
    frequency = float(sizes @ rates / np.sum(sizes))
    # What a filter that passes few harmonics may take.
    lost = _OF_HARMONICS * max(frequency / corner - 1.0 / _ENOUGH_HARMONICS, 0.0)
    share = held_share(trace)
    return ForceLevel(
        branches=constant,
        reversals=at_reversals,
        uncertainty=0.5 * abs(constant - at_reversals)
        + _OF_HYSTERESIS * hysteresis
        + _OF_GAS * gas.inside,
        expected=-gas.force,
        rebound_curvature=rebound / half_range,
        bump_curvature=bump / half_range,
        hidden=_OF_DIGRESSION * 0.5 * (max(-rebound, 0.0) + max(-bump, 0.0)) + lost * half_range,
        preloads=_preloads(v, f, 2.0 * math.pi * frequency * max(_TURN / corner, trace.interval)),
        held=share * half_range if share >= YIELDS else 0.0,
    )


def _preloads(v: FloatArray, f: FloatArray, turn: float) -> float:
    """Return what preloads may make of a level, of what turns faster than a filter shows, N."""
    speed = (min(turn, _WIDEST_TURN) * min(float(v.max()), -float(v.min())),)
    out, into = in_both_strokes(v, f[None], speed)[1][:, :, 0, 0]
    jump = 0.5 * abs(float(np.mean(out) - np.mean(into)))
    if not math.isfinite(jump):
        return 0.0
    return _OF_PRELOADS * max(jump - _OF_FRICTION * 0.5 * float(np.ptp(f)), 0.0)


def _branches(x: FloatArray, v: FloatArray, f: FloatArray) -> tuple[float, float, float]:
    """Return the constant, and the force in v^2 at peak speed of rebound and bump, N."""
    u, is_out, is_in = v / float(np.abs(v).max()), v > 0.0, v < 0.0
    columns = np.stack(
        [np.ones_like(x), x / float(np.ptp(x)), np.sign(v), u * is_out, u * is_in, u * u * is_out,
         u * u * is_in]
    )  # fmt: skip
    # The products of the columns have the square of their condition; what that costs in digits, a
    # second step on what is left gives back. On the columns themselves it takes far longer. Columns
    # may be made up by others: a pseudo-inverse.
    sizes, ways = np.linalg.eigh(columns @ columns.T)
    is_there = np.abs(sizes) > _MADE_UP * np.abs(sizes).max()
    inverse = (ways[:, is_there] / sizes[is_there]) @ ways[:, is_there].T
    found = inverse @ (columns @ f)
    found += inverse @ (columns @ (f - found @ columns))
    return float(found[0]), float(found[5]), -float(found[6])


def reversals(v: FloatArray) -> tuple[IntArray, FloatArray, BoolArray]:
    """Return the samples before reversals, the part of a sample behind, and which end a rebound."""
    is_out = v > 0.0  # a sample at rest, v = 0, belongs to what follows a rebound
    before = np.flatnonzero(is_out[:-1] != is_out[1:])
    return before, v[before] / (v[before] - v[before + 1]), is_out[before]
