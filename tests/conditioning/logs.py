"""Logs without integration: of f = a v|v| + b v + c sgn(v), and of Purdy's with stiff oil."""

from dataclasses import replace

import numpy as np

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import (
    PURDY_DAMPER,
    incompressible_force,
    reference_parameters,
)
from damperfit.recording import Recording

LAW = (3000.0, 1500.0, 50.0)
RATE = 1000.0


def static_force(velocity):
    """Force of the static damper, N."""
    a, b, c = LAW
    return a * velocity * np.abs(velocity) + b * velocity + c * np.sign(velocity)


def recording(time, displacement, force, *, temperature=None):
    """A recording with nothing said about its origin."""
    return Recording("log.csv", "log.csv", "", 1, time, displacement, force, temperature)


def changed(log, channel, change):
    """A log with a channel that a function has changed."""
    return replace(log, **{channel: change(getattr(log, channel).copy())})


def moving(x, *, rate=RATE):
    """What the static damper answers to a displacement, without noise."""
    return recording(np.arange(len(x)) / rate, x, static_force(np.gradient(x, 1.0 / rate)))


def sine_log(
    *, frequency=1.5, rate=1000.0, cycles=15.0, phase=1.1, amplitude=0.032, centre=0.0123, start=0.0
):
    """A sine test that is running when the log starts."""
    t = np.arange(round(cycles / frequency * rate)) / rate
    angle = 2.0 * np.pi * frequency * t + phase
    x = centre + amplitude * np.sin(angle)
    v = 2.0 * np.pi * frequency * amplitude * np.cos(angle)
    return recording(t + start, x, static_force(v))


def sine(frequency, amplitude, cycles):
    """A displacement that starts from the middle."""
    turns = frequency * np.arange(round(cycles / frequency * RATE)) / RATE
    return amplitude * np.sin(2.0 * np.pi * turns)


def logged(x, law=lambda _, v: static_force(v), *, steps=(0.0, 0.0), noise=(0.0, 3.0), warm=None):
    """A log of a law of x and v, with noise and steps of displacement (m) and force (N)."""
    random = np.random.default_rng(1)
    channels = []
    for values, step, size in zip(
        (x, law(x, np.gradient(x, 1.0 / RATE))), steps, noise, strict=True
    ):
        seen = values + size * random.standard_normal(len(values))
        channels.append(step * np.round(seen / step) if step else seen)
    return recording(np.arange(len(x)) / RATE, *channels, temperature=warm)


def moved(wave, t, *, frequency=1.5, amplitude=0.032, phase=1.1):
    """Displacement and velocity of a test."""
    w = 2 * np.pi * frequency
    a = w * t + phase
    if wave == "triangle":
        x = amplitude * 2 / np.pi * np.arcsin(np.sin(a))
        return x, amplitude * 2 / np.pi * w * np.sign(np.cos(a))
    crank = 0.03 if wave == "crank" else 0.0
    x = amplitude * (np.sin(a) + crank * np.cos(2 * a))
    return x, amplitude * w * (np.cos(a) - 2 * crank * np.sin(2 * a))


def made(
    wave="sine", *, setting=10, rate=500.0, noise=(4.0, 8e-6), bits=0, seed=1, cycles=15, **test
):
    """A log of the incompressible damper, with noise and a converter."""
    random = np.random.default_rng(seed)
    t = np.arange(round(cycles / test.get("frequency", 1.5) * rate)) / rate
    x, v = moved(wave, t, phase=random.uniform(0.0, 6.0), **test)
    f = incompressible_force(reference_parameters(setting), PURDY_DAMPER, x, v)
    f = f + noise[0] * random.normal(size=len(t))
    x = x + noise[1] * random.normal(size=len(t))
    if bits:
        x, f = (np.rint(s / q) * q for s, q in ((x, 0.1 / 2**bits), (f, 1.5 * np.ptp(f) / 2**bits)))
    return Recording("log.csv", "log.csv", "", setting, t, x, f, np.full(len(t), 26.0))


def speeds(*parts, noise=3e-6, seed=1):
    """A log of parts (frequency, amplitude, cycles); frequency 0 is a rest of so many seconds."""
    x, v = [], []
    for frequency, amplitude, cycles in parts:
        n = round((cycles / frequency if frequency else cycles) * RATE)
        turn = 2.0 * np.pi * frequency * np.arange(n) / RATE
        x.append(amplitude * np.sin(turn))
        v.append(amplitude * 2.0 * np.pi * frequency * np.cos(turn))
    x, v = np.concatenate(x), np.concatenate(v)
    random = np.random.default_rng(seed)
    x = x + noise * random.standard_normal(len(x))
    force = static_force(v) + 4.0 * random.standard_normal(len(x))
    return recording(np.arange(len(x)) / RATE, x, force)


def random_motion(seed, *, highest=5.0, rate=RATE, duration=20.0):
    """Time, displacement and velocity of a road of so many Hz at most."""
    random = np.random.default_rng(seed)
    t = np.arange(round(duration * rate)) / rate
    rates = np.arange(0.3, highest, 1.0 / duration)
    sizes, phases = random.standard_normal(len(rates)) / rates, random.uniform(0, 6.3, len(rates))
    turns = 2.0 * np.pi * rates[:, None] * t + phases[:, None]
    x, v = sizes @ np.sin(turns), (sizes * 2.0 * np.pi * rates) @ np.cos(turns)
    return t, 0.04 * x / np.abs(x).max(), 0.04 * v / np.abs(x).max()


def found(log_or_trace, options=None):
    """The last finding of each name."""
    is_trace = hasattr(log_or_trace, "findings") and hasattr(log_or_trace, "segments")
    trace = log_or_trace if is_trace else condition(log_or_trace, options or ConditionOptions())
    return {one.code: one for one in trace.findings}


def warned(log, options=None):
    """Warnings by name; that a log warms up is true of those that do, delays have their tests."""
    found_of = found(log, options)
    apart = {"skew", "temperature_drift"} if options is None else {"skew"}
    return {k: one for k, one in found_of.items() if one.severity == "warning" and k not in apart}
