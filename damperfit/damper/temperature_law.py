"""A damper whose oil was not always equally warm: what is viscous follows the temperature.

    R(T) = R exp(-beta (T - T_ref))

Of each resistance or damping that plays the part `VISCOUS` a fit finds its value at T_ref, and
beside them one beta for the whole damper. Turbulent orifices, openings, friction and gas keep their
values: the density of oil changes by 0.07 % a kelvin, its viscosity by 1 to 4 %.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from damperfit.damper.model import DAMPER, VISCOUS, Model, Quantity
from damperfit.errors import ConfigurationError
from damperfit.problem import Key, Option

if TYPE_CHECKING:
    from damperfit.damper.cylinder import Cavitation
    from damperfit.damper.model import FurtherStart, Names, Values
    from damperfit.damper.valve_dampers import ValveCharacteristic
    from damperfit.recording import Trace
    from damperfit.simulation import Motion, Response, SolverOptions

BETA = Quantity(
    "beta", "beta", "fall with temperature",
    "relative fall of the viscous resistances with each kelvin, R(T) = R exp(-beta (T - T_ref))",
    "1/K", (-0.5, 0.5), is_logarithmic=False, size=0.01, scope=DAMPER, power=-2, shown_unit="%/K",
    believable=(0.0, 0.08), belief="the viscosity of damper oils falls by 1 to 4 % a kelvin",
)  # fmt: skip
# What is asked of the damper itself, whatever the temperature.
_ITS_OWN = frozenset(
    {
        "name", "title", "conditions", "kinks", "ranges", "signals", "flaws",
        "gas", "parts", "chamber_lengths", "travel", "bulk_moduli", "rest_force",
    }
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class WithTemperature(Model):
    """A damper of any model with what temperature does to it.

    Raises
    ------
    ConfigurationError
        Nothing of the model is viscous.
    """

    damper: Model  # as it is at the reference temperature
    reference: float = math.nan  # T_ref, degrees Celsius; NaN: the mean of the logs, not yet read
    temperature: float | None = None  # of motions without their own; None: T_ref

    # One beta for all logs takes one fit of all.
    procedures: ClassVar[tuple[str, ...]] = ("joint", "plain")

    def __post_init__(self) -> None:
        """Refuse a model that temperature does nothing to."""
        if not self.viscous:
            raise ConfigurationError(
                f"nothing of the model {self.damper.name!r} is a viscous "
                "resistance that could follow a temperature; leave it out, or take another model",
                where=Key(("reference_temperature",)),
                code="not-viscous",
            )

    def __getattribute__(self, name: str) -> Any:
        """Return what the damper itself says, where temperature changes nothing."""
        if name in _ITS_OWN:
            return getattr(object.__getattribute__(self, "damper"), name)
        return object.__getattribute__(self, name)

    def __getattr__(self, name: str) -> Any:
        """Return what only its own model has: geometry, oil, valves."""
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(object.__getattribute__(self, "damper"), name)

    @property
    def viscous(self) -> tuple[str, ...]:
        """Names of what follows the temperature."""
        return tuple(q.name for q in self.damper.quantities if q.role == VISCOUS)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The damper's own, at T_ref, and beta."""
        return (*self.damper.quantities, BETA)

    @property
    def plain(self) -> Model:
        """The damper at T_ref."""
        return self.damper

    @property
    def sentence(self) -> str:
        """The damper's main figures, and at which temperature its resistances hold."""
        return f"{self.damper.sentence}{self.condition}"

    @property
    def condition(self) -> str:
        """At which temperature its resistances hold, to follow its main figures."""
        where = "the mean of the logs" if math.isnan(self.reference) else f"{self.reference:g} degC"
        return f"; {' and '.join(self.viscous)} are those at {where}"

    @property
    def oil_temperature(self) -> float:
        """Of motions without their own temperature, degrees Celsius."""
        return self.reference if self.temperature is None else self.temperature

    def at_reference(self, values: Values, temperature: float | None) -> Values:
        """Return values of the damper itself, as they are at a temperature; None: at its own."""
        numbers = dict(values)
        beta = numbers.pop(BETA.name)
        factor = math.exp(-beta * self._above(temperature))
        numbers |= {name: factor * numbers[name] for name in self.viscous}
        return self.damper.values_type(**numbers)

    def _above(self, temperature: float | None) -> float:
        """Return how far a temperature is above T_ref, K."""
        known = self.temperature if temperature is None else temperature
        return 0.0 if known is None or math.isnan(self.reference) else known - self.reference

    def simulate(
        self, values: Values, motion: Motion, *, sensitivities: Names, options: SolverOptions
    ) -> Response:
        """Return the damper's own response at the temperature of the motion."""
        own = self.at_reference(values, motion.temperature)
        above = self._above(motion.temperature)
        wanted = [name for name in sensitivities if name != BETA.name]
        if BETA.name in sensitivities:
            wanted += [name for name in self.viscous if name not in wanted]
        seen = self.damper.simulate(own, motion, sensitivities=tuple(wanted), options=options)
        slopes = dict(seen.sensitivities)
        if BETA.name in sensitivities:
            by_resistance = [getattr(own, name) * slopes[name] for name in self.viscous]
            slopes[BETA.name] = -above * np.sum(by_resistance, axis=0)
        factor = math.exp(-values.beta * above)
        slopes |= {name: factor * slopes[name] for name in self.viscous if name in slopes}
        return replace(seen, sensitivities={name: slopes[name] for name in sensitivities})

    def start(self, traces: Sequence[Trace], fixed: Mapping[str, float]) -> tuple[Values, ...]:
        """Return where the damper itself would start; the temperature does nothing there."""
        own = {name: value for name, value in fixed.items() if name != BETA.name}
        beta, starts = fixed.get(BETA.name, 0.0), self.damper.start(traces, own)
        return tuple(self.values(dict(start), beta=beta) for start in starts)

    def further_starts(
        self, start: Values, traces: Sequence[Trace], free: Names
    ) -> tuple[FurtherStart, ...]:
        """Return those of the damper itself."""
        own = self.at_reference(start, None)
        names = [name for name in free if name != BETA.name]
        return tuple(
            further._replace(start=self.values(dict(further.start), beta=start.beta))
            for further in self.damper.further_starts(own, traces, names)
        )

    def examine(
        self, values: Values, seen: Sequence[tuple[Trace, Response]], *, solver: SolverOptions
    ) -> Cavitation:
        """Return that of the damper itself, at the mean temperature of the logs."""
        own = self.at_reference(values, _mean([trace for trace, _ in seen]))
        return self.damper.examine(own, seen, solver=solver)

    def valve_characteristics(
        self, values: Values, traces: Sequence[Trace]
    ) -> tuple[ValveCharacteristic, ...]:
        """Return those of the damper itself, at the mean temperature of the logs."""
        return self.damper.valve_characteristics(self.at_reference(values, _mean(traces)), traces)

    def filled_to(self, gas_pressure: float | None) -> WithTemperature:
        """Return the same damper filled to another pressure, Pa; None: as it is declared."""
        return replace(self, damper=self.damper.filled_to(gas_pressure))


def at_temperature(damper: Model, temperature: float) -> Model:
    """Return a damper as it is at a temperature, degrees Celsius, if its parameters follow one."""
    if not isinstance(damper, WithTemperature):
        raise ConfigurationError(
            "these parameters do not follow a temperature; fit logs of several "
            "temperatures with damperfit identify --covariate temperature",
            where=Option("temperature"),
            code="no-temperature",
        )
    return replace(damper, temperature=temperature)


def _mean(traces: Sequence[Trace]) -> float | None:
    known = [trace.temperature for trace in traces if trace.temperature is not None]
    return float(np.mean(known)) if known else None
