"""Models of the literature: no geometry, and a force from a motion alone.

They are ranked beside the physical models on the same logs, and are what can be taken where nothing
physical is known. Each says where its equation comes from, and whether the original was at hand.
What is added to the force of each that has it: k x, a spring beside; f_f sgn v, Coulomb friction;
f_0, an offset. c, v and the like with r or b are of rebound or bump::

    linear       c v                        bilinear     c v, c of the direction
    degressive   c v/(1 + |v|/v_k)          four_slopes  c_1 v up to v_k, c_2 beyond
    polynomial_v             sum_i a_i v^i                     i <= 5
    polynomial_xv            sum_ij b_ij x^i v^j               i + j <= 3
    restoring_force_surface  sum_ij c_ij T_i(x/X) T_j(v/V)     i + j <= 6

Curves without hysteresis are what texts on vehicle dynamics, dyno software and vehicle simulations
hold; no source is needed. The surface with Chebyshev polynomials T is that of S. F. Masri and T. K.
Caughey, "A nonparametric identification technique for nonlinear dynamic problems", J. Appl. Mech.
46 (1979) 433; here the coefficients are fitted to the samples themselves, not to a grid laid over
them.

**A spring in series with a dashpot**, four models of the eighties and nineties::

    S(e),  e' = (v - D^-1(S(e))) s(x)

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

**Fluids that yield**::

    bouc_wen    c v + k x + alpha z,  z' = rho (v - sigma |v| |z|^(n-1) z + (sigma - 1) v |z|^n)
    biviscous   the middle one of  c_po v - f_y,  c_pr (v -+ v_0),  c_po v + f_y
    kwok        c v + k x + alpha tanh(beta v + delta sgn x)

bouc_wen: z runs between -1 and 1. Y. K. Wen, "Method for random vibration of hysteretic systems",
    J. Eng. Mech. Div. ASCE 102 (1976) 249, after R. Bouc 1967; in this normalised form F. Ikhouane
    and J. Rodellar, "Systems with Hysteresis", Wiley 2007.
biviscous: - where the acceleration is positive, + where it is negative. N. M. Wereley, L. Pang and
    G. M. Kamath, "Idealized hysteresis modeling of electrorheological and magnetorheological
    dampers", J. Intell. Mater. Syst. Struct. 9 (1998) 642; there both directions have one f_y and
    one c_po.
kwok: N. M. Kwok, Q. P. Ha, T. H. Nguyen, J. Li and B. Samali, "A novel hysteretic model for
    magnetorheological fluid dampers and parameter identification using particle swarm
    optimization", Sensors and Actuators A 132 (2006) 441.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from damperfit.arrays import FloatArray
from damperfit.compiled_core import compiled_core
from damperfit.damper.model import FRICTION, OFFSET, RIGID, VISCOUS, Model, Quantity
from damperfit.errors import SimulationError
from damperfit.simulation import Motion, Response, SolverOptions, describe_ending

if TYPE_CHECKING:
    from damperfit.damper.model import Names, Values
    from damperfit.recording import Trace

    Law = tuple[FloatArray, dict[str, FloatArray]]
    Numbers = Mapping[str, float]

_LATER_TEXTS = "The original was not at hand; the equation is as later texts give it."
_WAYS = (("r", "rebound"), ("b", "bump"))
_ROUNDING = 0.01  # of the root of an orifice at no force, N
_AT_ONCE = 1e10  # 1/m
_MIDDLE = 1e-4  # m: within, the sign of x is x/_MIDDLE, so that the force does not jump


def _positive(name: str, meaning: str, unit: str, low: float, high: float, **more: Any) -> Quantity:
    """A quantity that is fitted by its logarithm."""
    known = {"symbol": name, "label": meaning} | more
    return Quantity(name=name, meaning=meaning, unit=unit, plausible=(low, high), **known)


def _signed(name: str, meaning: str, unit: str, size: float, role: str = "") -> Quantity:
    """A quantity of either sign; it is looked for within 10^4 times its size."""
    limits = (-1e4 * size, 1e4 * size)
    return Quantity(
        name, name, meaning, meaning, unit, limits, is_logarithmic=False, size=size, role=role
    )


def _each_way(*rows: tuple[str, str, str, float, float], symbol: str = "", role: str = "") -> Any:
    """The quantities of rebound, then those of bump: in names and symbols {} is their letter."""
    return tuple(
        _positive(
            *(name.format(k), f"{meaning} in {way}", unit, low, high),
            symbol=(symbol or name).format(k),
            role=role,
        )
        for k, way in _WAYS
        for name, meaning, unit, low, high in rows
    )


_OFFSET = _signed("f_0", "force offset", "N", 100.0, OFFSET)
_FRICTION = _positive("f_f", "Coulomb friction", "N", 1e-3, 1e5, label="friction", role=FRICTION)


class _Drive(NamedTuple):
    """A motion, as a law sees it; SI."""

    motion: Motion
    options: SolverOptions

    @property
    def x(self) -> FloatArray:
        return self.motion.displacement

    @property
    def v(self) -> FloatArray:
        return self.motion.velocity

    @property
    def strokes(self) -> tuple[tuple[str, FloatArray], tuple[str, FloatArray]]:
        """The speed in rebound and in bump, with the letters of their quantities."""
        return ("r", np.maximum(self.v, 0.0)), ("b", np.minimum(self.v, 0.0))

    def follow(
        self, numbers: Sequence[float], layout: Sequence[int]
    ) -> tuple[FloatArray, FloatArray]:
        """Return a state's output, shape (n,), and its derivatives by the k numbers, (k, n).

        The layout is that of `run_state` in module.c: empty for Bouc and Wen.
        """
        x = np.ascontiguousarray(self.x, dtype=np.float64)
        v = np.ascontiguousarray(self.v, dtype=np.float64)
        output, slopes = np.empty(len(x)), np.empty((len(x), len(numbers)))
        code, sample = compiled_core().follow(
            np.array(numbers, dtype=np.float64), np.array(layout, dtype=np.intc), x, v, output,
            slopes, self.motion.interval, _ROUNDING,
        )  # fmt: skip
        if code:
            raise SimulationError(
                describe_ending(code, sample, self.motion, self.options), code="not-integrated"
            )
        return output, np.ascontiguousarray(slopes.T)


class _Seen:
    """What is compared of some logs, end to end; SI."""

    def __init__(self, traces: Sequence[Trace]) -> None:
        self.x, self.v, self.f = (
            np.concatenate([getattr(trace, name)[trace.compared] for trace in traces])
            for name in ("displacement", "velocity", "force")
        )
        speeds = np.abs(self.v)
        self.speed = float(np.max(speeds))
        self.stroke = float(np.ptp(self.x))
        # Where the rod is slow: gas and offset.
        self.middle = float(np.mean(self.f[speeds <= np.quantile(speeds, 0.1)]))
        rebound = max(float(np.max(self.f) - self.middle), 1.0)
        bump = max(float(self.middle - np.min(self.f)), 1.0)
        self.peaks = (("r", rebound), ("b", bump))  # beyond the middle, by the quantities' letters
        self.both = rebound + bump


@dataclass(frozen=True)
class Rival(Model):
    """A model of the literature: a force from displacement and velocity."""

    # As its equation has them, then spring, friction and offset.
    quantities: ClassVar[tuple[Quantity, ...]]
    source: ClassVar[str] = "textbook"  # where its equation comes from
    caveat: ClassVar[str] = ""  # what a reader has to know of how it was taken over

    @abstractmethod
    def _law(self, y: Values, at: _Drive) -> Law:
        """Return the force without spring, friction and offset, N, and its derivatives."""

    @abstractmethod
    def _guesses(self, seen: _Seen) -> Iterable[Numbers]:
        """Return numbers to start from, several where it may have several local minima."""

    def simulate(
        self, values: Values, motion: Motion, *, sensitivities: Names, options: SolverOptions
    ) -> Response:
        """Return force and sensitivities; it has no pressures."""
        for name in sensitivities:
            self.quantity(name)
        beside = {
            "k": motion.displacement,
            # Within the dead band of the velocity a share of it.
            "f_f": np.clip(motion.velocity / options.dead_band, -1.0, 1.0),
            "f_0": np.ones_like(motion.velocity),
        }
        with np.errstate(all="ignore"):
            force, slopes = self._law(values, _Drive(motion, options))
            for name, row in beside.items():
                if name in values.names:
                    force, slopes[name] = force + values[name] * row, row
        n = len(force)
        if not np.all(np.isfinite(force)):
            raise SimulationError(
                "the force is not a finite number.", subject=self.title, code="not-finite"
            )
        return Response(
            time=motion.start_time + motion.interval * np.arange(n, dtype=np.float64),
            displacement=motion.displacement,
            velocity=motion.velocity,
            force=force,
            pressures=np.full((3, n), np.nan),
            masses=np.full((2, n), np.nan),
            sensitivities={name: slopes[name] for name in sensitivities},
        )

    def start(self, traces: Sequence[Trace], fixed: Mapping[str, float]) -> tuple[Values, ...]:
        """Return where a fit may start, from forces and speeds of the logs."""
        seen = _Seen(traces)
        beside = {"k": 0.0, "f_f": 0.02 * seen.both, "f_0": seen.middle}
        starts = []
        for guess in self._guesses(seen):
            numbers = {**beside, **guess}
            within = {
                q.name: float(np.clip(numbers[q.name], *q.plausible)) for q in self.quantities
            }
            starts.append(self.values(within | dict(fixed)))
        return tuple(starts)


class Linear(Rival):
    """One damping coefficient and an offset."""

    name = "linear"
    title = "linear damping with offset"
    quantities = (_positive("c", "damping coefficient", "N s/m", 1e-2, 1e7, role=VISCOUS), _OFFSET)

    def _law(self, y: Values, at: _Drive) -> Law:
        return y.c * at.v, {"c": at.v}

    def _guesses(self, seen: _Seen) -> Iterable[Numbers]:
        return ({"c": seen.both / (2.0 * seen.speed)},)


class Bilinear(Rival):
    """A damping coefficient for each direction and an offset."""

    name = "bilinear"
    title = "bilinear damping with offset"
    quantities = (
        *_each_way(("c_{}", "damping coefficient", "N s/m", 1e-2, 1e7), role=VISCOUS),
        _OFFSET,
    )

    def _law(self, y: Values, at: _Drive) -> Law:
        slopes = {f"c_{k}": part for k, part in at.strokes}
        return y.c_r * slopes["c_r"] + y.c_b * slopes["c_b"], slopes

    def _guesses(self, seen: _Seen) -> Iterable[Numbers]:
        return ({f"c_{k}": peak / seen.speed for k, peak in seen.peaks},)


class Degressive(Rival):
    """A slope at rest and a speed beyond which it fades, for each direction."""

    name = "degressive"
    title = "degressive curve with friction"
    quantities = (
        *_each_way(
            ("c_{}", "slope at rest", "N s/m", 1e-1, 1e7),
            ("v_{}", "speed of half that slope", "m/s", 1e-4, 1e3),
        ),
        *(_FRICTION, _OFFSET),
    )

    def _law(self, y: Values, at: _Drive) -> Law:
        force, slopes = np.zeros_like(at.v), {}
        for k, part in at.strokes:
            c, v_k = y[f"c_{k}"], y[f"v_{k}"]
            share = part / (1.0 + np.abs(part) / v_k)
            force = force + c * share
            slopes[f"c_{k}"] = share
            slopes[f"v_{k}"] = c * share * np.abs(share) / v_k**2
        return force, slopes

    def _guesses(self, seen: _Seen) -> Iterable[Numbers]:
        for at in (1.0, 0.2):  # of the highest speed, where half of the slope is lost
            slopes = {f"c_{k}": (1.0 + 1.0 / at) * peak / seen.speed for k, peak in seen.peaks}
            yield slopes | {"v_r": at * seen.speed, "v_b": at * seen.speed}


class FourSlopes(Rival):
    """Two slopes and the knee between them, for each direction."""

    name = "four_slopes"
    title = "four slopes with friction"
    quantities = (
        *_each_way(
            ("c_{}1", "slope up to the knee", "N s/m", 1e-1, 1e7),
            ("c_{}2", "slope beyond the knee", "N s/m", 1e-2, 1e7),
            ("v_{}", "speed of the knee", "m/s", 1e-4, 1e2),
        ),
        *(_FRICTION, _OFFSET),
    )

    def _law(self, y: Values, at: _Drive) -> Law:
        force, slopes = np.zeros_like(at.v), {}
        for k, part in at.strokes:
            first, second, v_k = y[f"c_{k}1"], y[f"c_{k}2"], y[f"v_{k}"]
            slow = np.clip(part, -v_k, v_k)
            fast = part - slow
            force = force + first * slow + second * fast
            slopes[f"c_{k}1"], slopes[f"c_{k}2"] = slow, fast
            slopes[f"v_{k}"] = (first - second) * np.sign(fast)
        return force, slopes

    def _guesses(self, seen: _Seen) -> Iterable[Numbers]:
        for at in (0.4, 0.1):  # of the highest speed, with a fifth of the slope beyond
            guess: dict[str, float] = {}
            for k, peak in seen.peaks:
                first = peak / (seen.speed * (at + 0.2 * (1.0 - at)))
                guess |= {f"c_{k}1": first, f"c_{k}2": 0.2 * first, f"v_{k}": at * seen.speed}
            yield guess


def _pairs(degree: int) -> tuple[tuple[int, int], ...]:
    return tuple((i, n - i) for n in range(degree + 1) for i in range(n + 1))


def _unit(i: int, j: int) -> str:
    """N, or N s^j/m^(i + j)."""
    if i + j == 0:
        return "N"
    over = f"m{i + j}" if i + j > 1 else "m"
    return f"N{f' s{j}' if j > 1 else ' s' if j else ''}/{over}"


class _Terms(Rival):
    """A sum of terms with a number each: what they are worth follows from least squares at once."""

    @abstractmethod
    def _terms(self, x: FloatArray, v: FloatArray) -> FloatArray:
        """Return the terms, a row each."""

    def _law(self, y: Values, at: _Drive) -> Law:
        rows = self._terms(at.x, at.v)
        return np.asarray(y.numbers) @ rows, dict(zip(self.names, rows, strict=True))

    def _guesses(self, seen: _Seen) -> Iterable[Numbers]:
        numbers = np.linalg.lstsq(self._terms(seen.x, seen.v).T, seen.f, rcond=None)[0]
        return (dict(zip(self.names, map(float, numbers), strict=True)),)


class PolynomialInSpeed(_Terms):
    """A polynomial of fifth degree in velocity."""

    name = "polynomial_v"
    title = "polynomial in velocity, degree 5"
    quantities = tuple(
        _signed(f"a_{j}", f"coefficient of v^{j}", _unit(0, j), 1e3) for j in range(6)
    )

    def _terms(self, x: FloatArray, v: FloatArray) -> FloatArray:  # noqa: ARG002
        return np.vander(v, 6, increasing=True).T


class PolynomialInStrokeAndSpeed(_Terms):
    """A polynomial of third degree in displacement and velocity."""

    name = "polynomial_xv"
    title = "polynomial in displacement and velocity, degree 3"
    powers = _pairs(3)  # in displacement and velocity, a pair a term
    quantities = tuple(
        _signed(f"b_{i}{j}", f"coefficient of x^{i} v^{j}", _unit(i, j), 1e3 * 30.0**i)
        for i, j in _pairs(3)
    )

    def _terms(self, x: FloatArray, v: FloatArray) -> FloatArray:
        return np.array([x**i * v**j for i, j in self.powers])


@dataclass(frozen=True)
class RestoringForceSurface(_Terms):
    """Chebyshev polynomials up to the sixth degree over displacement and velocity.

    X and V, m and m/s, are where their arguments are 1: far beyond what was fitted they say
    nothing.
    """

    half_stroke: float = 0.05
    top_speed: float = 0.5

    name = "restoring_force_surface"
    title = "restoring-force surface, degree 6"
    source = "Masri and Caughey 1979"
    caveat = _LATER_TEXTS
    powers = _pairs(6)
    quantities = tuple(
        _signed(f"c_{i}{j}", f"coefficient of T_{i}(x/X) T_{j}(v/V)", "N", 1e4)
        for i, j in _pairs(6)
    )

    def _terms(self, x: FloatArray, v: FloatArray) -> FloatArray:
        over_x = chebyshev.chebvander(x / self.half_stroke, 6)
        over_v = chebyshev.chebvander(v / self.top_speed, 6)
        return np.array([over_x[:, i] * over_v[:, j] for i, j in self.powers])


_STIFFNESS = _positive("k_s", "stiffness in series with the dashpot", "N/m", 1e2, 1e10, ideal=RIGID)
_PLAY = _positive("play", "play of the joints", "m", 1e-7, 1e-1, ideal=0.0)
_SPRING = _signed("k", "stiffness of the gas beside", "N/m", 1e3)
_DAMPINGS = _each_way(("c_{}", "damping", "N s/m", 1e-2, 1e9), role=VISCOUS)
_SQUARES = ("q_{}", "root of the square damping", "s sqrt(N)/m")


class _ElasticDashpot(Rival):
    """What the four have in common: which quantities their spring and their dashpots take."""

    # Names of stiffness, play and half length; empty: it has none.
    spring: ClassVar[tuple[str, str, str]] = ("k_s", "", "")
    # Ways through the dashpot of rebound: force at which it opens, c, q; F = c v + (q v)^2.
    ways: ClassVar[tuple[tuple[str, str, str], ...]]

    caveat = (
        "The original was not at hand; what it is made of follows later texts that compare models."
    )

    def _law(self, y: Values, at: _Drive) -> Law:
        names = [name for name in self.names if name not in {"k", "f_f", "f_0"}]
        place = {"": -1} | {name: k for k, name in enumerate(names)}
        layout = [place[name] for name in self.spring]
        for k, _ in _WAYS:
            for way in self.ways:
                layout += [int(k == "r"), *(place[name.replace("_r", f"_{k}")] for name in way)]
        force, rows = at.follow([y[name] for name in names], layout)
        return force, dict(zip(names, rows, strict=True))

    def _guesses(self, seen: _Seen) -> Iterable[Numbers]:
        stiff = max(peak for _, peak in seen.peaks) / seen.stroke
        (_, c, q), *beyond = self.ways
        for give in (0.01, 0.1):  # of the stroke, by which the spring gives
            for share in (0.8, 0.3):
                guess = {"k_s": stiff / give, "play": 0.2 * give * seen.stroke}
                guess |= {"half_length": 3.0 * seen.stroke}
                for k, peak in seen.peaks:
                    linear = share if c and q else float(bool(c))  # of the peak force
                    if beyond:  # a knee at a share of it, and a fifth of the slope beyond
                        linear = share + 5.0 * (1.0 - share)
                        knee = {"p_r": share * peak, "c_r2": 0.25 * linear * peak / seen.speed}
                        guess |= {n.replace("_r", f"_{k}"): number for n, number in knee.items()}
                    root = float(np.sqrt(max(1.0 - linear, 0.0) * peak)) / seen.speed
                    own = {c: linear * peak / seen.speed, q: root}
                    guess |= {n.replace("_r", f"_{k}"): number for n, number in own.items()}
                yield guess


class KaradayiMasada(_ElasticDashpot):
    """Spring, play and a linear dashpot for each direction, in series."""

    name = "karadayi_masada"
    title = "Karadayi-Masada"
    source = "Karadayi and Masada 1986"
    spring = ("k_s", "play", "")
    ways = (("", "c_r", ""),)
    quantities = (_STIFFNESS, _PLAY, *_DAMPINGS, _OFFSET)


class HagedornWallaschek(_ElasticDashpot):
    """The same with a square term for each direction, friction and a spring beside: nine."""

    name = "hagedorn_wallaschek"
    title = "Hagedorn-Wallaschek"
    source = "Hagedorn and Wallaschek 1987"
    spring = ("k_s", "play", "")
    ways = (("", "c_r", "q_r"),)
    quantities = (
        *(_STIFFNESS, _PLAY, *_DAMPINGS, *_each_way((*_SQUARES, 1e-4, 1e5))),
        *(_SPRING, _FRICTION, _OFFSET),
    )


class SuraceWordenTomlinson(_ElasticDashpot):
    """Two chambers of compressible oil and an orifice between them, with friction."""

    name = "surace_worden_tomlinson"
    title = "Surace-Worden-Tomlinson"
    source = "Surace, Worden and Tomlinson 1992"
    spring = ("k_s", "", "half_length")
    ways = (("", "", "q_r"),)
    quantities = (
        _STIFFNESS,
        _positive(
            *("half_length", "half of the tube: stiffer as the piston nears an end", "m"),
            *(1e-3, 1e2),
            symbol="l",
        ),
        *(*_each_way((*_SQUARES, 1e-2, 1e5)), _FRICTION, _OFFSET),
    )


class BesingerCebonCole(_ElasticDashpot):
    """Spring, a dashpot of two slopes and a knee for each direction: seven, and friction."""

    name = "besinger_cebon_cole"
    title = "Besinger-Cebon-Cole"
    source = "Besinger, Cebon and Cole 1995"
    ways = (("", "c_r1", ""), ("p_r", "c_r2", ""))
    quantities = (
        _STIFFNESS,
        *_each_way(
            ("c_{}1", "damping up to the knee", "N s/m", 1e-2, 1e9),
            ("c_{}2", "damping of what opens at the knee", "N s/m", 1e-2, 1e9),
            role=VISCOUS,
        ),
        *_each_way(("p_{}", "force of the knee", "N", 1e-1, 1e6)),
        *(_FRICTION, _OFFSET),
    )


class BoucWen(Rival):
    """Hysteresis that depends on the path alone, with damping and a spring beside it."""

    name = "bouc_wen"
    title = "Bouc-Wen"
    source = "Wen 1976; Ikhouane and Rodellar 2007"
    caveat = _LATER_TEXTS
    # Dampers have shape and sharpness at their edges too: back on a straight line, a sharp turn.
    quantities = (
        _positive("alpha", "height of the hysteresis", "N", 1e-2, 1e6),
        _positive("rho", "1/rho is the stroke of the reversal", "1/m", 1.0, 1e6, ideal=_AT_ONCE),
        _positive("sigma", "shape of reversal", "1", 0.5, 1e2, has_own_edges=True),
        _positive("n", "sharpness of reversal", "1", 1.0, 2e1, has_own_edges=True),
        *_each_way(("c_{}", "viscous damping", "N s/m", 1e-3, 1e7)),
        *(_signed("k", "stiffness", "N/m", 1e3), _OFFSET),
    )

    def _law(self, y: Values, at: _Drive) -> Law:
        z, by = at.follow([y.rho, y.sigma, y.n], ())
        slopes = {f"c_{k}": part for k, part in at.strokes}
        force = y.c_r * slopes["c_r"] + y.c_b * slopes["c_b"] + y.alpha * z
        names = zip(("rho", "sigma", "n"), by, strict=True)
        return force, slopes | {"alpha": z} | {name: y.alpha * row for name, row in names}

    def _guesses(self, seen: _Seen) -> Iterable[Numbers]:
        for share, turn in ((0.3, 100.0), (0.7, 10.0)):  # within 1/turn of the stroke
            guess = {f"c_{k}": (1.0 - share) * peak / seen.speed for k, peak in seen.peaks}
            guess |= {"alpha": share * seen.both / 2.0, "rho": turn / seen.stroke}
            yield guess | {"sigma": 1.0, "n": 1.5}


class Biviscous(Rival):
    """Two slopes a direction, and a speed by which the branches of the loop lie apart."""

    name = "biviscous"
    title = "hysteretic bi-viscous"
    source = "Wereley, Pang and Kamath 1998"
    caveat = _LATER_TEXTS
    quantities = (
        _positive("c_pr", "damping before it yields", "N s/m", 1e-1, 1e8),
        _positive("v_0", "speed between the branches", "m/s", 1e-6, 1e1),
        *_each_way(("c_{}", "damping after it yields", "N s/m", 1e-2, 1e7), symbol="c_po,{}"),
        *_each_way(("f_{}", "yield force", "N", 1e-2, 1e6), symbol="f_y,{}"),
        _OFFSET,
    )

    def _law(self, y: Values, at: _Drive) -> Law:
        v = at.v
        side = np.sign(np.gradient(v)) if len(v) > 1 else np.zeros_like(v)
        before = y.c_pr * (v - side * y.v_0)
        high, low = y.c_r * v + y.f_r, y.c_b * v - y.f_b
        above, below = before > high, before < low
        between = np.asarray(~above & ~below, dtype=np.float64)
        slopes: dict[str, FloatArray] = {
            "c_pr": between * (v - side * y.v_0),
            "v_0": -y.c_pr * between * side,
            "c_r": above * v,
            "c_b": below * v,
            "f_r": np.asarray(above, dtype=np.float64),
            "f_b": -np.asarray(below, dtype=np.float64),
        }
        return np.where(above, high, np.where(below, low, before)), slopes

    def _guesses(self, seen: _Seen) -> Iterable[Numbers]:
        steep = 10.0 * seen.both / (2.0 * seen.speed)
        for share in (0.7, 0.25):  # of the peak forces, at which it yields
            guess = {"c_pr": steep, "v_0": 0.03 * seen.speed}
            for k, peak in seen.peaks:
                guess |= {f"c_{k}": (1.0 - share) * peak / seen.speed, f"f_{k}": share * peak}
            yield guess


class Kwok(Rival):
    """Viscous, elastic and hysteretic force side by side."""

    name = "kwok"
    title = "Kwok's hyperbolic tangent"
    source = "Kwok et al. 2006"
    caveat = _LATER_TEXTS
    quantities = (
        _positive("c", "viscous damping", "N s/m", 1e-3, 1e7),
        _signed("k", "stiffness", "N/m", 1e3),
        _positive("alpha", "height of the hysteresis", "N", 1e-2, 1e6),
        _positive("beta", "steepness by velocity", "s/m", 1e-2, 1e5),
        _signed("delta", "width of the hysteresis", "1", 1.0),
        _OFFSET,
    )

    def _law(self, y: Values, at: _Drive) -> Law:
        side = np.clip(at.x / _MIDDLE, -1.0, 1.0)
        bend = np.tanh(y.beta * at.v + y.delta * side)
        steep = y.alpha * (1.0 - bend**2)
        slopes = {"c": at.v, "alpha": bend, "beta": steep * at.v, "delta": steep * side}
        return y.c * at.v + y.alpha * bend, slopes

    def _guesses(self, seen: _Seen) -> Iterable[Numbers]:
        # Three steepnesses; the rest by least squares with them held.
        for beta in (2.0 / seen.speed, 8.0 / seen.speed, 30.0 / seen.speed):
            rows = [seen.v, seen.x, np.tanh(beta * seen.v), np.ones_like(seen.v)]
            solution = np.linalg.lstsq(np.array(rows).T, seen.f, rcond=None)[0]
            c, k, alpha, offset = map(float, solution)
            of_shape = {"c": abs(c), "k": k, "alpha": abs(alpha), "f_0": offset}
            yield of_shape | {"beta": beta, "delta": 0.1}


RIVALS: tuple[type[Rival], ...] = (
    Linear, Bilinear, PolynomialInSpeed, PolynomialInStrokeAndSpeed, RestoringForceSurface,
    Degressive, FourSlopes, KaradayiMasada, HagedornWallaschek, SuraceWordenTomlinson,
    BesingerCebonCole, BoucWen, Biviscous, Kwok,
)  # fmt: skip
