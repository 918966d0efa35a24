"""Recordings of a damper that needs no integration: f = a v|v| + b v + c sgn(v)."""

from __future__ import annotations

import numpy as np

from damperfit.recording import Recording

LAW = (3000.0, 1500.0, 50.0)


def static_force(velocity):
    """Force of the static damper, N."""
    a, b, c = LAW
    return a * velocity * np.abs(velocity) + b * velocity + c * np.sign(velocity)


def recording(time, displacement, force, *, temperature=None):
    """A recording with nothing said about its origin."""
    return Recording("log.csv", "log.csv", "", 1, time, displacement, force, temperature)


def sine_log(
    *, frequency=1.5, rate=1000.0, cycles=15.0, phase=1.1, amplitude=0.032, centre=0.0123, start=0.0
):
    """A sine test that is running when the log starts."""
    t = np.arange(round(cycles / frequency * rate)) / rate
    angle = 2.0 * np.pi * frequency * t + phase
    x = centre + amplitude * np.sin(angle)
    v = 2.0 * np.pi * frequency * amplitude * np.cos(angle)
    return recording(t + start, x, static_force(v))
