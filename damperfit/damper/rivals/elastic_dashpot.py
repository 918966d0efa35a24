"""A spring in series with a dashpot: four models of the eighties and nineties.

    f = S(e) + k x + f_f sgn v + f_0,    e' = (v - D^-1(S(e))) s(x)

S is the spring beyond half the play on either side, D the dashpot of the direction, and s(x) = 1
but where the spring is oil in two chambers. `core/hysteresis.c` follows e.

karadayi_masada: play, a linear dashpot for each direction. R. Karadayi and G. Y. Masada, "A
    nonlinear shock absorber model", ASME AMD 80 (1986).
hagedorn_wallaschek: play, a linear and square dashpot for each direction, k beside. P. Hagedorn and
    J. Wallaschek, "On equivalent harmonic and stochastic linearization for nonlinear
    shock-absorbers", IUTAM symposium, Innsbruck 1987.
besinger_cebon_cole: no play, a dashpot of two slopes for each direction. F. H. Besinger, D. Cebon
    and D. J. Cole, "Damper models for heavy vehicle ride dynamics", Vehicle System Dynamics 24
    (1995) 35.
surace_worden_tomlinson: two columns of oil for a spring, an orifice for each direction. C. Surace,
    K. Worden and G. R. Tomlinson, "On the non-linear characteristics of automotive shock
    absorbers", Proc. IMechE D 206 (1992) 3.

None of the four originals was at hand. What each is made of follows later texts that compare them;
where these do not say how a part enters, it is as above.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from damperfit.damper.quantity import RIGID
from damperfit.damper.rivals.following import follow
from damperfit.damper.rivals.rival import (
    FRICTION,
    OFFSET,
    ComparedLogs,
    Rival,
    Slopes,
    damping,
    friction,
    positive,
    signed,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.damper.rivals.rival import FloatArray
    from damperfit.simulation import Motion, SolverOptions

__all__ = ["BesingerCebonCole", "HagedornWallaschek", "KaradayiMasada", "SuraceWordenTomlinson"]

_STIFFNESS = replace(
    positive("k_s", "k_s", "stiffness in series with the dashpot", "N/m", (1e2, 1e10)), ideal=RIGID
)
_PLAY = replace(positive("play", "play", "play of the joints", "m", (1e-7, 1e-1)), ideal=0.0)
_SPRING = signed("k", "k", "stiffness of the gas beside", "N/m", 1e3)
_BESIDE = {"k", "f_f", "f_0"}  # the spring in series
_WAYS = (("r", "rebound"), ("b", "bump"))


@dataclass(frozen=True)
class _ElasticDashpot(Rival):
    """What the four have in common: which quantities their spring and their dashpots take."""

    caveat: ClassVar[str] = (
        "The original was not at hand; what it is made of follows later texts that compare models."
    )
    spring: ClassVar[tuple[str, str, str]] = ("k_s", "", "")
    """Names of stiffness, play and half length; empty: it has none."""
    ways: ClassVar[tuple[tuple[int, str, str, str], ...]] = ()
    """Ways through the dashpot: 1 for rebound, force at which it opens, c, q; F = c v + (q v)^2."""

    def law(self, y: Values, motion: Motion, options: SolverOptions) -> tuple[FloatArray, Slopes]:
        """Return the spring's force with friction and offset."""
        names = [one.name for one in self.quantities if one.name not in _BESIDE]
        place = {"": -1} | {name: k for k, name in enumerate(names)}
        layout = [place[name] for name in self.spring]
        for is_rebound, *own in self.ways:
            layout += [is_rebound, *(place[name] for name in own)]
        numbers = np.array([getattr(y, name) for name in names])
        force, rows = follow(numbers, layout, motion, options)
        slopes = dict(zip(names, rows, strict=True)) | {"f_0": np.ones_like(force)}
        force = force + y.f_0
        if "f_f" in self.names:
            slopes["f_f"] = friction(motion, options)
            force = force + y.f_f * slopes["f_f"]
        if "k" in self.names:
            slopes["k"] = motion.displacement
            force = force + y.k * motion.displacement
        return force, slopes

    @abstractmethod
    def dashpot(self, k: str, peak: float, speed: float, share: float) -> dict[str, float]:
        """Return the numbers of a direction's dashpot from its peak force."""

    def guess(self, seen: ComparedLogs) -> tuple[Mapping[str, float], ...]:
        """Return springs that give by a hundredth and by a tenth of the stroke."""
        stroke, peak = float(np.ptp(seen.x)), max(seen.rebound, seen.bump)
        return tuple(
            self.dashpot("r", seen.rebound, seen.speed, share)
            | self.dashpot("b", seen.bump, seen.speed, share)
            | {
                "k_s": peak / (give * stroke),
                "play": 0.2 * give * stroke,
                "half_length": 3.0 * stroke,
                "k": 0.0,
                "f_f": 0.02 * (seen.rebound + seen.bump),
                "f_0": seen.middle,
            }
            for give in (0.01, 0.1)
            for share in (0.8, 0.3)
        )


def _dampings(*ends: str) -> tuple[Quantity, ...]:
    what = {
        "": "damping",
        "1": "damping up to the knee",
        "2": "damping of what opens at the knee",
    }
    return tuple(
        damping(f"c_{k}{end}", f"{what[end]} in {way}", (1e-2, 1e9))
        for k, way in _WAYS
        for end in ends
    )


def _squares(low: float = 1e-4) -> tuple[Quantity, ...]:
    return tuple(
        positive(
            f"q_{k}", f"q_{k}", f"root of the square damping in {way}", "s sqrt(N)/m", (low, 1e5)
        )
        for k, way in _WAYS
    )


@dataclass(frozen=True)
class KaradayiMasada(_ElasticDashpot):
    """Spring, play and a linear dashpot for each direction, in series."""

    name: ClassVar[str] = "karadayi_masada"
    title: ClassVar[str] = "Karadayi-Masada"
    source: ClassVar[str] = "Karadayi and Masada 1986"
    spring: ClassVar[tuple[str, str, str]] = ("k_s", "play", "")
    ways: ClassVar[tuple[tuple[int, str, str, str], ...]] = ((1, "", "c_r", ""), (0, "", "c_b", ""))

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return k_s, play, c_r, c_b and f_0."""
        return (_STIFFNESS, _PLAY, *_dampings(""), OFFSET)

    def dashpot(self, k: str, peak: float, speed: float, share: float) -> dict[str, float]:  # noqa: ARG002
        """Return the damping of the peak force."""
        return {f"c_{k}": peak / speed}


@dataclass(frozen=True)
class HagedornWallaschek(_ElasticDashpot):
    """The same with a square term for each direction, friction and a spring beside: nine."""

    name: ClassVar[str] = "hagedorn_wallaschek"
    title: ClassVar[str] = "Hagedorn-Wallaschek"
    source: ClassVar[str] = "Hagedorn and Wallaschek 1987"
    spring: ClassVar[tuple[str, str, str]] = ("k_s", "play", "")
    ways: ClassVar[tuple[tuple[int, str, str, str], ...]] = (
        (1, "", "c_r", "q_r"),
        (0, "", "c_b", "q_b"),
    )

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return k_s, play, c and q of both directions, k, friction and f_0."""
        return (_STIFFNESS, _PLAY, *_dampings(""), *_squares(), _SPRING, FRICTION, OFFSET)

    def dashpot(self, k: str, peak: float, speed: float, share: float) -> dict[str, float]:
        """Return dampings that share the peak force."""
        root = float(np.sqrt((1.0 - share) * peak)) / speed
        return {f"c_{k}": share * peak / speed, f"q_{k}": root}


@dataclass(frozen=True)
class BesingerCebonCole(_ElasticDashpot):
    """Spring, a dashpot of two slopes and a knee for each direction: seven, and friction."""

    name: ClassVar[str] = "besinger_cebon_cole"
    title: ClassVar[str] = "Besinger-Cebon-Cole"
    source: ClassVar[str] = "Besinger, Cebon and Cole 1995"
    ways: ClassVar[tuple[tuple[int, str, str, str], ...]] = (
        (1, "", "c_r1", ""),
        (1, "p_r", "c_r2", ""),
        (0, "", "c_b1", ""),
        (0, "p_b", "c_b2", ""),
    )

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return k_s, both slopes and the knee of both directions, friction and f_0."""
        knees = (
            positive(f"p_{k}", f"p_{k}", f"force of the knee in {way}", "N", (1e-1, 1e6))
            for k, way in _WAYS
        )
        return (_STIFFNESS, *_dampings("1", "2"), *knees, FRICTION, OFFSET)

    def dashpot(self, k: str, peak: float, speed: float, share: float) -> dict[str, float]:
        """Return a knee at a share of the peak force, and a fifth of the slope beyond."""
        first = peak * (share + 5.0 * (1.0 - share)) / speed
        return {f"c_{k}1": first, f"p_{k}": share * peak, f"c_{k}2": 0.25 * first}


@dataclass(frozen=True)
class SuraceWordenTomlinson(_ElasticDashpot):
    """Two chambers of compressible oil and an orifice between them, with friction."""

    name: ClassVar[str] = "surace_worden_tomlinson"
    title: ClassVar[str] = "Surace-Worden-Tomlinson"
    source: ClassVar[str] = "Surace, Worden and Tomlinson 1992"
    spring: ClassVar[tuple[str, str, str]] = ("k_s", "", "half_length")
    ways: ClassVar[tuple[tuple[int, str, str, str], ...]] = ((1, "", "", "q_r"), (0, "", "", "q_b"))

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return k_s, half length, q of both directions, friction and f_0."""
        length = positive(
            "half_length",
            "l",
            "half of the tube: stiffer as the piston nears an end",
            "m",
            (1e-3, 1e2),
        )
        return (_STIFFNESS, length, *_squares(1e-2), FRICTION, OFFSET)

    def dashpot(self, k: str, peak: float, speed: float, share: float) -> dict[str, float]:  # noqa: ARG002
        """Return the orifice of the peak force."""
        return {f"q_{k}": float(np.sqrt(peak)) / speed}
