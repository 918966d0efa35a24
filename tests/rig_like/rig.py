"""Logs of dampers as rigs write them, from an integrator that has nothing of the core's.

`rig.c` steps a damper of passages; here are the passages of the three layouts, what drives the rig,
and what lies between the rod and the file: a lag of the force channel, a cell zeroed before
mounting, drift, hum, noise, steps of the converter.
"""

import ctypes
import hashlib
import math
import os
import shlex
import subprocess
import tempfile
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

FINE = 1e-4  # s, between the places where motion and force are kept
AMBIENT = 101325.0
ROUND = 400.0  # Pa, of rig.c
HERE = Path(__file__).parent


@dataclass(frozen=True)
class Valve:
    """A valve of one stroke, SI: p_open, R, S, and the cost of a power-law stack, Pa (s/kg)^n."""

    bleed: float = 0.0
    leak: float = 0.0
    opening: float = 0.0
    slope: float = 0.0
    cost: float = 0.0
    power: float = 1.0

    def ways(self, start: int, end: int, *, is_two_way: bool = True) -> list[tuple[float, ...]]:
        """Its bleed, then its blow-off."""
        found: list[tuple[float, ...]] = []
        if self.bleed or self.leak:
            found.append((start, end, is_two_way, 0.0, self.leak, self.bleed, 0.0, 1.0))
        if self.slope or self.cost:
            more = (self.opening, self.slope, 0.0, self.cost, self.power)
            found.append((start, end, 0.0, *more))
        return found


def _through_flow(rebound: Valve, bump: Valve, check: Valve) -> list[tuple[float, ...]]:
    return [*rebound.ways(1, 3), *check.ways(3, 1), *bump.ways(2, 3), *check.ways(3, 2)]


def _twin_tube(rebound: Valve, bump: Valve, check: Valve) -> list[tuple[float, ...]]:
    return [*rebound.ways(1, 2), *check.ways(2, 1), *bump.ways(2, 3), *check.ways(3, 2)]


def _monotube(rebound: Valve, bump: Valve, check: Valve) -> list[tuple[float, ...]]:
    del check
    return [*rebound.ways(1, 2, is_two_way=False), *bump.ways(2, 1, is_two_way=False)]


LAYOUTS = {"through_flow": _through_flow, "twin_tube": _twin_tube, "monotube": _monotube}


@dataclass(frozen=True)
class Body:
    """A damper and its mounting, SI."""

    layout: str
    rebound: Valve
    bump: Valve
    check: Valve = Valve(slope=2.5e5)
    rod: float = 8.9e-3
    piston: float = 25e-3
    length: float = 60e-3
    density: float = 850.0
    gas_pressure: float = 4.46e5
    gas_volume: float = 2e-5
    gas_exponent: float = 1.3
    bulk: float = 1e9
    free_gas: float = 0.0
    stiffness: float = 5e5
    play: float = 0.0
    mass: float = 0.05
    friction: float = 20.0
    breakaway: float = 0.0
    stribeck: float = 0.0
    seal: float = 0.0
    presliding: float = 2e-6
    drag: float = 0.0
    rubber: float = 0.0
    rubber_bend: float = 4e-4

    @property
    def areas(self) -> tuple[float, float]:
        """Of the rod and of the bore, m2."""
        return math.pi * self.rod**2 / 4, math.pi * self.piston**2 / 4

    @property
    def numbers(self) -> list[float]:
        """As rig.c counts them."""
        damping = 0.4 * math.sqrt(self.stiffness * self.mass)
        return [
            *self.areas, self.length, self.length, self.density, self.gas_pressure,
            self.gas_volume, self.gas_exponent, AMBIENT, self.bulk, self.free_gas, self.stiffness,
            self.play, damping, self.mass, self.friction, self.breakaway, self.stribeck, self.seal,
            self.presliding, self.drag, float(self.layout == "monotube"),
            self.rubber, self.rubber_bend,
        ]  # fmt: skip

    @property
    def ways(self) -> list[tuple[float, ...]]:
        """Its passages."""
        return LAYOUTS[self.layout](self.rebound, self.bump, self.check)

    @property
    def fastest(self) -> float:
        """A rate that no change of its state exceeds, 1/s."""
        rod, bore = self.areas
        give = self.bulk / (self.density * 0.4 * self.length * (bore - rod))
        steep = 0.0
        for chamber in (1, 2):
            mine = [way[4:] for way in self.ways if chamber in way[:2]]
            steep = max(steep, sum(_steepest(*one) for one in mine))
        bristle = 1.4 * math.sqrt((self.friction + self.breakaway) / self.presliding / self.mass)
        stiff = self.stiffness + self.rubber / self.rubber_bend
        ends = 0.4 * math.sqrt(stiff / self.mass) + bristle
        return max(give * steep, 2 * ends)


def _steepest(linear: float, root: float, cost: float, power: float) -> float:
    """How fast a passage's flow grows with its pressure at most, kg/(s Pa); the root is rounded."""
    if cost:
        return (1e4 / cost) ** (1 / power) / 1e4
    return 1.0 / (linear + 0.7 * root * math.sqrt(ROUND))


@dataclass(frozen=True)
class Channels:
    """What lies between the rod and the file."""

    rate: float = 1000.0
    lag: float = 0.0
    noise: float = 4.0  # N
    jitter: float = 8e-6  # m
    hum: float = 0.0  # m, 50 Hz in the displacement
    step: float = 0.0  # N
    click: float = 0.0  # m
    drift: float = 0.0  # N over the log
    offset: float = 0.0  # N


@dataclass(frozen=True, eq=False)
class Logged:
    """What a rig has written, and what is behind it."""

    time: np.ndarray
    displacement: np.ndarray
    force: np.ndarray
    pressures: np.ndarray = field(repr=False)


@cache
def _library() -> ctypes.CDLL:
    """rig.c, compiled once on a machine."""
    source = HERE / "rig.c"
    name = hashlib.sha256(source.read_bytes()).hexdigest()[:16]
    built = Path(tempfile.gettempdir()) / f"damperfit_rig_{os.getuid()}_{name}.so"
    if not built.exists():
        with tempfile.TemporaryDirectory(dir=built.parent) as folder:
            made = Path(folder) / built.name
            compiler = shlex.split(os.environ.get("CC", "cc"))
            command = [*compiler, "-O2", "-std=c99", "-fPIC", "-shared", str(source)]
            subprocess.run([*command, "-o", str(made), "-lm"], check=True)
            made.replace(built)
    return ctypes.CDLL(str(built))


def pulled(body: Body, x: np.ndarray, v: np.ndarray, *, finer: int = 1) -> np.ndarray:
    """Return the pull at the rod's end and P1, P2, P3 at places `FINE` apart, shape (4, n)."""
    kinds = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
    run = _library().rig_run
    run.argtypes = [kinds, kinds, ctypes.c_int, kinds, kinds, ctypes.c_int,
                    ctypes.c_double, ctypes.c_int, kinds]  # fmt: skip
    ways = np.array(body.ways, dtype=np.float64)
    out = np.empty((len(x), 4))
    n_steps = finer * max(1, math.ceil(FINE * body.fastest / 2.0))
    ended = run(np.array(body.numbers), ways, len(ways), np.ascontiguousarray(x),
                np.ascontiguousarray(v), len(x) - 1, FINE, n_steps, out)  # fmt: skip
    assert ended == 0, f"rig.c ran away at sample {ended}: {body}"
    return out.T


def crank(
    frequency: float, amplitude: float, cycles: float, *, second: float = 0.0, up: float = 0.6,
    down: float = 1.2, rest: float = 0.5,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return x and v of a crank with run-up, steady cycles and coast-down."""
    ramp = np.linspace(0.0, frequency, round(up / FINE))
    steady = np.full(round(cycles / frequency / FINE), frequency)
    still = np.zeros(round(rest / FINE))
    return _turned([still, ramp, steady, np.linspace(frequency, 0.0, round(down / FINE)), still],
                   amplitude, second)  # fmt: skip


def steps(
    speeds: tuple[float, ...], amplitude: float, cycles: float, *, second: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return x and v of peak speeds one after the other, each swept in over half a second."""
    rates, last = [np.zeros(round(0.3 / FINE))], 0.0
    for speed in speeds:
        own = speed / (2 * math.pi * amplitude)
        rates += [np.linspace(last, own, round(0.5 / FINE)),
                  np.full(round((cycles + 0.3) / own / FINE), own)]  # fmt: skip
        last = own
    rates.append(np.linspace(last, 0.0, round(0.5 / FINE)))
    return _turned(rates, amplitude, second)


def _turned(
    rates: list[np.ndarray], amplitude: float, second: float
) -> tuple[np.ndarray, np.ndarray]:
    rate = np.concatenate(rates)
    # The angle's speed has no corners, as the rig's flywheel does not allow them.
    smooth = np.convolve(np.pad(rate, 500, "edge"), np.full(1001, 1 / 1001), "valid")
    speed = 2 * math.pi * smooth
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) * FINE
    x = amplitude * (np.sin(angle) + second / 2 * (1 - np.cos(2 * angle)))
    return x, amplitude * speed * (np.cos(angle) + second * np.sin(2 * angle))


def logged(
    body: Body, motion: tuple[np.ndarray, np.ndarray], channels: Channels, seed: int
) -> Logged:
    """Return what the rig writes of a motion."""
    x, v = motion
    pull, *pressures = pulled(body, x, v)
    if channels.lag:
        keep = math.exp(-FINE / channels.lag)
        from scipy.signal import lfilter

        pull, _ = lfilter([1 - keep], [1, -keep], pull, zi=[keep * pull[0]])
    at = np.round(np.arange(0.0, (len(x) - 1) * FINE, 1.0 / channels.rate) / FINE).astype(int)
    time = np.arange(len(at)) / channels.rate
    chance = np.random.default_rng([seed, 11])
    where = np.interp(time, np.arange(len(x)) * FINE, x)
    force = np.interp(time, np.arange(len(x)) * FINE, pull)
    where += chance.normal(0.0, channels.jitter, len(at))
    where += channels.hum * np.sin(2 * math.pi * 50.0 * time + chance.uniform(0, 6))
    force += chance.normal(0.0, channels.noise, len(at)) + channels.offset
    force += channels.drift * time / time[-1]
    for signal, click in ((where, channels.click), (force, channels.step)):
        if click:
            signal[:] = np.round(signal / click) * click
    return Logged(time, where, force, np.array(pressures)[:, at])
