"""Simulations of one setting: whose parameters, which motion, one test or a sweep."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from damperfit.configuration.options import parameter_value
from damperfit.damper.purdy.parameters import PURDY_DAMPER, Damper
from damperfit.damper.purdy.reference import FAMILIES, REFERENCE_SOURCE, reference_parameters
from damperfit.damper.warmed import BETA, Warmed
from damperfit.errors import (
    ConfigurationError,
    DamperfitError,
    InternalError,
    SimulationError,
    did_you_mean,
    mishap_of,
)
from damperfit.identification import unlimited_in, values_from_others
from damperfit.io import read_log
from damperfit.problem import Option, listed_names
from damperfit.reporting.simulated import SweepMember
from damperfit.results import Run, Tested
from damperfit.run.logs import Labels, conditioned_as_tested, facts_of
from damperfit.simulation import (
    Characteristics,
    Response,
    characterise,
    motion_of,
    refuse_amplitude,
    simulate,
    sine_motion,
    triangle_motion,
)
from damperfit.store import settle
from damperfit.tables.columns import unknown_schema
from damperfit.tables.reading import is_part, part_in, table_quantities
from damperfit.tested.setting import ADJUSTER, Setting, parse_setting

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Model, Values
    from damperfit.damper.quantity import Quantity
    from damperfit.recording import Trace
    from damperfit.simulation import Motion

__all__ = [
    "PAPER_SWEEPS",
    "ChosenParameters",
    "SimulatedTest",
    "Variation",
    "choose_parameters",
    "damper_of",
    "damper_of_table",
    "numbers_in",
    "parse_variation",
    "run_sweep",
    "simulate_test",
    "swept_units",
    "table_meant",
    "truth_of",
]


# Whose parameters a table holds: the configuration with the damper of the run that wrote it.


def damper_of_table(
    table: Path, configuration: Configuration, *, config: Path | None = None
) -> tuple[Configuration, str]:
    """Return the configuration with the damper that a table belongs to, and a line on it.

    Parameters
    ----------
    table : pathlib.Path
        Of parameters.
    configuration : Configuration
        As the user gave it.
    config : pathlib.Path, optional
        The file it came from, for the message.

    Raises
    ------
    ConfigurationError
        The user declares another damper than the one that was fitted.
    """
    run = Run.load(table)
    meant = run.configured(configuration, config=config, takes_motion=True)
    if run.declared_damper is None:
        said = f"; {run.source} does not say whose parameters these are"
    else:
        said = f", that of {run.source}"
    if schema := unknown_schema(run.record):
        said = f"{said}; {schema}"
    return meant, meant.damper_sentence_from(said)


# One simulated test: whose parameters, which motion, what comes of it.

# A cycle: at 33 the force at 0.05 m/s is up to 50 N off, at 333 half a newton
# (`tests/test_told_figures.py`).
_FEW_SAMPLES = 200
_PILOT_SAMPLES = 100  # of one cycle: the integrator's own steps are more
_WAVES = {"sine": sine_motion, "triangle": triangle_motion}


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedTest:
    """A simulated test.

    Attributes
    ----------
    choice : ChosenParameters
        Whose parameters.
    motion : str
        What drove the damper, for people.
    frequency : float
        Cycles per second, Hz.
    response : Response
        The signals, all cycles.
    characteristics : Characteristics
        Figures of the last cycle.
    temperature : float or None
        That was asked for, degrees Celsius.
    """

    choice: ChosenParameters
    motion: str
    frequency: float
    response: Response
    characteristics: Characteristics
    temperature: float | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before believing the figures, a sentence each."""
        fastest = float(np.max(np.abs(self.response.velocity)))
        amplitude = 0.5 * float(np.ptp(self.response.displacement))
        said = list(
            self.choice.warnings(
                fastest, self.temperature, amplitude=amplitude, frequency=self.frequency
            )
        )
        if self.samples_a_cycle < _FEW_SAMPLES:
            said.append(
                f"{self.samples_a_cycle:.3g} samples a cycle: peaks, hysteresis and forces at a "
                f"speed are coarse; {_FEW_SAMPLES} or more are wanted (--sample-rate)"
            )
        for chamber, share in enumerate(self.characteristics.cavitation_shares, start=1):
            if share > 0.0:
                said.append(
                    f"chamber {chamber} is empty for {100.0 * share:.3g} % of the cycle: these are "
                    "the forces of a damper that cavitates; a slower motion or more gas keeps it "
                    "full"
                )
        return tuple(said)

    @property
    def samples_a_cycle(self) -> float:
        """How finely a cycle is sampled."""
        interval = float(self.response.time[1] - self.response.time[0])
        return 1.0 / (self.frequency * interval)


def damper_of(
    choice: ChosenParameters, configuration: Configuration, *, config: Path | None = None
) -> tuple[Configuration, str]:
    """Return the configuration with the damper that the parameters belong to, and a line on it.

    Parameters
    ----------
    choice : ChosenParameters
        Whose parameters.
    configuration : Configuration
        As the user gave it.
    config : pathlib.Path, optional
        The file it came from, for the message.

    Raises
    ------
    ConfigurationError
        The user declares another damper than the one that was fitted, or asks what temperature does
        to one that was fitted without it.
    """
    meant, line = configuration, configuration.damper_sentence
    if choice.table is not None:
        meant, line = damper_of_table(choice.table, configuration, config=config)
    if isinstance(meant.damper, Warmed) and BETA.name not in choice.parameters.names:
        raise ConfigurationError(
            f"damper.reference_temperature: {choice.source.partition(': ')[2]}, has no beta; leave "
            "the key out, or take results of identify with {covariate}",
            covariate=Option("covariate", "temperature"),
        )
    return meant, line


def simulate_test(
    choice: ChosenParameters, configuration: Configuration, *, log: Path | None = None
) -> SimulatedTest:
    """Simulate a test with a wave, or with the displacement of a log.

    Parameters
    ----------
    choice : ChosenParameters
        Parameters.
    configuration : Configuration
        Damper, nominal test, solver; for a log also how to read and condition it.
    log : pathlib.Path, optional
        Rig log whose displacement drives the damper.

    Raises
    ------
    LogError
        The log cannot be read or evaluated.
    InternalError
        Reading it has met a bug of damperfit's.
    ConfigurationError
        The stroke is longer than a chamber, or the work is more than `simulation.max_steps`.
    SimulationError
        The model cannot be integrated, or the response is shorter than one cycle.
    """
    solver = configuration.simulation.solver
    asked = getattr(configuration.damper, "temperature", None)
    if log is None:
        refuse_amplitude(configuration.rig.amplitude, configuration.damper.travel)
        _refuse_work(choice.parameters, configuration)
        motion, words = _wave(configuration)
        response = simulate(choice.parameters, configuration.damper, motion, options=solver)
        frequency, steady = configuration.rig.frequency, response
    else:
        trace = _trace(log, configuration)
        motion = motion_of(trace)
        if asked is not None:  # before what the log says
            motion = replace(motion, temperature=asked)
        response = simulate(choice.parameters, configuration.damper, motion, options=solver)
        frequency, steady = trace.frequency, _part(response, trace.fastest.window)
        words = f"displacement of {trace.name}, last of {trace.fastest.n_cycles} steady cycles"
    figures = characterise(steady, frequency, speeds=configuration.output.speeds)
    if log is None and configuration.simulation.wave == "triangle":
        # It holds one speed a stroke: what lies below is passed in the jump, between two samples.
        figures = replace(
            figures, speed_forces=(), hysteresis_rebound=math.nan, hysteresis_bump=math.nan
        )
    return SimulatedTest(choice, words, frequency, response, figures, asked)


def _trace(log: Path, configuration: Configuration) -> Trace:
    try:
        recording = read_log(log, configuration.reading)
        row = Labels([log], configuration).row(log)
        facts, _ = facts_of(recording, log, configuration, row)
        return conditioned_as_tested(recording, configuration.conditioning, facts)
    except (DamperfitError, MemoryError):
        raise
    except Exception as error:
        mishap = mishap_of(error, f"reading {log.name}")
        raise InternalError(mishap.message) from error


def _wave(configuration: Configuration) -> tuple[Motion, str]:
    rig, options = configuration.rig, configuration.simulation
    motion = _WAVES[options.wave](
        rig.amplitude,
        rig.frequency,
        cycles=options.cycles,
        sample_rate=options.sample_rate,
    )
    words = (
        f"{options.wave} of {1e3 * rig.amplitude:.4g} mm at {rig.frequency:.4g} Hz, "
        f"last of {options.cycles:g} cycles"
    )
    return motion, words


def _refuse_work(parameters: Values, configuration: Configuration) -> None:
    """Estimate samples and steps before any are made, the steps from one cycle."""
    rig, options = configuration.rig, configuration.simulation
    n_samples = options.cycles * options.sample_rate / rig.frequency
    n_steps = n_samples
    if n_samples <= options.max_steps:
        rate = rig.frequency * min(_PILOT_SAMPLES, options.sample_rate / rig.frequency)
        cycle = _WAVES[options.wave](rig.amplitude, rig.frequency, cycles=1, sample_rate=rate)
        with suppress(SimulationError):  # the simulation itself will say why
            pilot = simulate(parameters, configuration.damper, cycle, options=options.solver)
            n_steps = max(n_samples, options.cycles * pilot.work.steps)
    if n_steps > options.max_steps:
        raise ConfigurationError(
            f"{options.cycles:g} cycles at {rig.frequency:g} Hz take about {n_samples:.3g} samples "
            f"and {n_steps:.3g} steps of the integrator, expected at most {options.max_steps} "
            "(simulation.max_steps); take fewer {cycles} or a lower {sample_rate}, or allow more "
            "with {max_steps}",
            cycles=Option("cycles"),
            sample_rate=Option("sample_rate"),
            max_steps=Option("max_steps", math.ceil(1.1 * n_steps)),
            code="too-much-work",
        )


def _part(response: Response, window: slice) -> Response:
    signals = ("time", "displacement", "velocity", "force", "pressures", "masses")
    return replace(response, **{name: getattr(response, name)[..., window] for name in signals})


# One quantity scaled by factors, everything else held: the families of the paper's Figs 4-9.


@dataclass(frozen=True, slots=True)
class Variation:
    """What is varied.

    Attributes
    ----------
    name : str
        One of `swept_units`.
    factors : tuple of float
        In the order given.
    """

    name: str
    factors: tuple[float, ...]


_GAS = {"p_0": "gas_pressure", "gamma": "gas_exponent"}

PAPER_SWEEPS = tuple(Variation(one.name, one.factors) for one in FAMILIES)


def swept_units(damper: Model) -> dict[str, str]:
    """Return what of a damper and its test can be varied, with units.

    Parameters
    ----------
    damper : Model
        Of any model: its quantities, stroke and frequency; of the paper's the gas too, which is a
        quantity of other dampers with gas.
    """
    gas = {"p_0": "Pa", "gamma": ""} if isinstance(damper, Damper) else {}
    own = {one.name: one.unit for one in damper.quantities}
    return own | gas | {"amplitude": "m", "frequency": "Hz"}


def parse_variation(text: str, damper: Model = PURDY_DAMPER) -> Variation:
    """Return what NAME=F1,F2,... asks for.

    Parameters
    ----------
    text : str
        As typed.
    damper : Model
        Whose quantities there are.

    Raises
    ------
    ConfigurationError
        The name is unknown, or a factor is no number, negative, or zero where that is no damper.

    Examples
    --------
    >>> parse_variation("P_0=0.5,1,2")
    Variation(name='p_0', factors=(0.5, 1.0, 2.0))
    """
    name, equals, factors = (part.strip() for part in text.partition("="))
    name = name.lower()
    if not (name and equals and factors):
        raise ConfigurationError(
            f"expected NAME=F1,F2,..., as in {damper.names[0]}=0.8,1,1.2",
            where=Option("vary", text),
            code="not-a-variation",
        )
    units = swept_units(damper)
    if name not in units:
        known = ", ".join(units)
        hint = did_you_mean(name, units)
        raise ConfigurationError(
            f"no {name!r}; there are {known}.{hint}",
            where=Option("vary", text),
            code="unknown-name",
        )
    values = tuple(_factor(part, text) for part in factors.split(","))
    may_be_zero = [one.name for one in damper.quantities if one.may_vanish or one.is_offset]
    if min(values) == 0.0 and name not in may_be_zero:
        raise ConfigurationError(
            f"{name} times 0 is not a damper; give factors above 0",
            where=Option("vary", text),
            code="not-a-damper",
        )
    if len(set(values)) < len(values):
        raise ConfigurationError(
            "a factor is given twice", where=Option("vary", text), code="given-twice"
        )
    return Variation(name, values)


def _factor(text: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise ConfigurationError(
            f"{text!r} is not a number", where=Option("vary", whole), code="not-a-number"
        ) from error
    if not (math.isfinite(value) and value >= 0.0):
        raise ConfigurationError(
            f"{text}: expected a factor of 0 or more",
            where=Option("vary", whole),
            code="out-of-range",
        )
    return value


def run_sweep(
    choice: ChosenParameters, configuration: Configuration, *, variation: Variation
) -> tuple[SweepMember, ...]:
    """Simulate the nominal test once for each factor.

    Parameters
    ----------
    choice : ChosenParameters
        Whose parameters.
    configuration : Configuration
        Damper, nominal test, solver.
    variation : Variation
        What is scaled, by what.

    Returns
    -------
    tuple of SweepMember
        In the order of the factors.

    Raises
    ------
    ConfigurationError
        The quantity is zero, so that no factor changes it, or the stroke becomes too long.
    SimulationError
        The model cannot be integrated.
    """
    base = _value(choice, configuration, variation.name)
    if base == 0.0:
        raise ConfigurationError(f"{variation.name} is 0 here: no factor changes it")
    members = []
    for factor in variation.factors:
        try:
            changed = _changed(choice, configuration, variation.name, value=base * factor)
        except ConfigurationError as error:
            raise ConfigurationError(
                "{error}", error=error, where=Option("vary", f"{factor:g}", variation.name)
            ) from error
        test = simulate_test(*changed)
        figures = (test.frequency, test.response, test.characteristics)
        members.append(SweepMember(factor, base * factor, *figures))
    return tuple(members)


def _value(choice: ChosenParameters, configuration: Configuration, name: str) -> float:
    if name in choice.parameters.names:
        return float(getattr(choice.parameters, name))
    if name in _GAS:
        return float(getattr(configuration.damper, _GAS[name]))
    return float(getattr(configuration.rig, name))


def _changed(
    choice: ChosenParameters, configuration: Configuration, name: str, *, value: float
) -> tuple[ChosenParameters, Configuration]:
    if name in choice.parameters.names:
        return replace(choice, parameters=choice.parameters.replace({name: value})), configuration
    rig, damper = configuration.rig, configuration.damper
    if isinstance(damper, Damper) and name in _GAS:
        damper = replace(damper, **{_GAS[name]: value})
    elif name == "amplitude":
        rig = rig.but(amplitude=value)
    else:
        rig = rig.but(frequency=value)
    return choice, replace(configuration, rig=rig, damper=damper)


# Whose parameters a test is simulated with, and what is known of them.

_WARMER = 1.0  # K; so much a log drifts by itself
_TABLES = ("parameters.parquet", "parameters.csv")


@dataclass(frozen=True, slots=True)
class ChosenParameters:
    """Parameters and where they came from.

    Attributes
    ----------
    parameters : Values
        SI.
    setting : Setting or None
        Adjuster setting, None when all parameters were given one by one.
    source : str
        One sentence for people.
    table : pathlib.Path or None
        Where they stand; None for the reference set, and when all were given.
    unlimited : tuple of str
        Those to which the logs of their setting set no upper limit.
    is_combined : bool
        No log of the setting was fitted: they come from other settings with its clicks.
    tested : Tested
        What the logs of the run covered.
    """

    parameters: Values
    setting: Setting | None
    source: str
    table: Path | None = None
    unlimited: tuple[str, ...] = ()
    is_combined: bool = False
    tested: Tested = Tested()

    def warnings(
        self,
        peak_speed: float,
        temperature: float | None = None,
        *,
        amplitude: float | None = None,
        frequency: float | None = None,
    ) -> tuple[str, ...]:
        """Return what to know before believing a force on such a motion (SI) at so many degC."""
        said, names = [], listed_names(self.unlimited)
        outside = self.tested.outside
        is_beyond = any(outside(speed=peak_speed))
        if beyond := list(outside(amplitude=amplitude, frequency=frequency, speed=peak_speed)):
            said.append(f"never tested: {', '.join(beyond)}; there the force is extrapolated")
        if temperature is not None and self.tested.temperatures is not None:
            low, high = self.tested.temperatures
            if temperature < low - _WARMER or temperature > high + _WARMER:
                said.append(
                    f"{temperature:.3g} degC: the tests were at {low:.3g} to {high:.3g} degC; "
                    "beyond that the viscosity is extrapolated"
                )
        if names and self.is_combined:
            said.append(
                f"{names} at setting {self.setting}: the logs of the settings that it is put "
                "together from set no upper limit, so these forces may be far off; fit a log of "
                "this setting, or replace the value"
            )
        elif names and is_beyond:
            said.append(
                f"{names}: the logs of setting {self.setting} set no upper limit, so the force "
                "beyond their speeds may be far off"
            )
        return tuple(said)


def choose_parameters(
    setting: Setting | int | str | None,
    *,
    table: Path | None,
    replaced: Mapping[str, str],
    folder: Path = Path("results"),
    damper: Model = PURDY_DAMPER,
) -> ChosenParameters:
    """Return the parameters to simulate with.

    Parameters
    ----------
    setting : Setting, int, str or None
        Adjuster setting, or its label; not needed when all parameters are replaced.
    table : pathlib.Path or None
        Parameters table or results folder; None takes the table in ``folder`` when there is one,
        else the reference set.
    replaced : mapping of str to str
        Values that replace the setting's, as text with or without a unit.
    folder : pathlib.Path
        Where `identify` writes its results.
    damper : Model
        The model, where all are replaced or no table tells its own.

    Raises
    ------
    ConfigurationError
        No setting, an unknown setting, an unknown name, or a table that cannot be read.
    """
    if all(one.name in replaced for one in damper.quantities if one.default is None):
        if table is not None:
            raise ConfigurationError(
                "nothing is taken from it, as {set_option} gives all parameters; leave one of the "
                "two out",
                set_option=Option("set"),
                where=Option("parameters", table),
            )
        chosen_name = None if setting is None else _meant(setting)
        given = damper.values(_replaced(damper.quantities, replaced))
        return ChosenParameters(given, chosen_name, "parameters: all given")
    path = _table(table, folder)
    quantities = damper.quantities if path is None else table_quantities(path)
    values = _replaced(quantities, replaced)
    if setting is None:
        needed = (one.name for one in quantities if one.default is None)
        missing = ", ".join(name for name in needed if name not in values)
        raise ConfigurationError(
            f"no parameters for {missing}: give {{setting}} or {{set_option}} them all",
            setting=Option("setting", "N"),
            set_option=Option("set"),
            code="no-parameters",
        )
    if path is None and damper.name != PURDY_DAMPER.name:
        raise ConfigurationError(
            f"there is no reference set of the model {damper.name!r}: give {{parameters}}, or "
            "all of them by {set_option}",
            parameters=Option("parameters", "FILE"),
            set_option=Option("set"),
            code="no-parameters",
        )
    if path is None:
        chosen = _meant(setting)
        if isinstance(chosen.cell, str):
            raise ConfigurationError(
                "not in the reference set; expected a whole number, 1 to 20",
                where=Option("setting", setting),
                code="unknown-setting",
            )
        found = ChosenParameters(reference_parameters(chosen.cell), chosen, "")
        source = f"setting {chosen} of the {REFERENCE_SOURCE}"
    else:
        run = Run.load(path)
        known = {one.setting: one.parameters for one in run.settings}
        chosen = _meant(setting, known)
        together = None if chosen in known else values_from_others(known, chosen)
        if chosen not in known and together is None:
            there = ", ".join(str(number) for number in sorted(known)) or "none"
            raise ConfigurationError(
                f"no parameters of setting {chosen}; there are {there}",
                subject=path,
                code="unknown-setting",
            )
        unlimited = {one.setting: frozenset(one.unlimited) for one in run.settings}
        parameters = known[chosen] if together is None else together
        names = unlimited.get(chosen, frozenset())
        if together is not None:
            names = frozenset(unlimited_in(together, known, unlimited))
        left = tuple(name for name in parameters.names if name in names and name not in values)
        found = ChosenParameters(
            parameters, chosen, "", path, left, together is not None, run.tested
        )  # fmt: skip
        source = f"setting {chosen} of {path}"
        if together is not None:
            source = f"setting {chosen}, put together from the clicks of the settings of {path}"
    if values:
        source = f"{source}; replaced: {', '.join(values)}"
    return replace(
        found, parameters=found.parameters.replace(values), source=f"parameters: {source}"
    )


def _replaced(quantities: Sequence[Quantity], texts: Mapping[str, str]) -> dict[str, float]:
    known = {one.name: one for one in quantities}
    for name in texts:
        if name not in known:
            raise ConfigurationError(
                f"no parameter {name!r}; there are {', '.join(known)}.{did_you_mean(name, known)}",
                code="unknown-parameter",
            )
    return {name: parameter_value(known[name], text) for name, text in texts.items()}


def _meant(setting: Setting | int | str, known: Collection[Setting] = ()) -> Setting:
    """Return the setting that a label names, best among those that are known."""
    if not isinstance(setting, str):
        return Setting.of(setting)
    named = {one.label.casefold(): one for one in known}
    adjusters = next(iter(known)).adjusters if known else (ADJUSTER,)
    try:
        return named.get(setting.strip().casefold()) or parse_setting(setting, adjusters)
    except ValueError as error:
        raise ConfigurationError(f"{error}", where=Option("setting", setting)) from error


def _table(given: Path | None, folder: Path) -> Path | None:
    """Return the parameters table that is meant; by default the one in a folder, if it is there."""
    if given is not None:
        return table_meant(given)
    settle(folder)
    return _table_in(folder)


def table_meant(given: Path) -> Path:
    """Return the parameters table that is meant; a folder means the one in it, or the part.

    Raises
    ------
    ConfigurationError
        A folder without one.
    """
    if is_part(given):
        return part_in(given)
    if not given.is_dir():
        return given
    settle(given)  # what an interrupted run put there may be none of the results
    found = _table_in(given)
    if found is None:
        raise ConfigurationError(
            f"no {_TABLES[0]} in this folder", subject=given, code="no-results"
        )
    return found


def _table_in(folder: Path) -> Path | None:
    return next((folder / name for name in _TABLES if (folder / name).exists()), None)


# What `samples` is asked for: true values of a table, a list of settings.

_MOST = 1000  # settings; more is a slip of the keyboard


def truth_of(
    given: Path, configuration: Configuration, config: Path | None
) -> tuple[dict[int, Values], Configuration, str]:
    """Return the values of a table, and the configuration and line of the damper they hold for."""
    path = table_meant(given)
    meant, damper = damper_of_table(path, configuration, config=config)
    known = {one.setting.cell: one.values for one in Run.load(path).settings}
    truth = {setting: values for setting, values in known.items() if isinstance(setting, int)}
    return truth, meant, damper


def numbers_in(text: str | Sequence[int]) -> tuple[int, ...]:
    """Return the settings that a list such as ``1,5,10-12`` names.

    Raises
    ------
    ConfigurationError
        It names none, or too many.
    """
    text = text if isinstance(text, str) else ",".join(map(str, text))
    try:
        numbers: list[int] = []
        for part in text.split(","):
            first, _, last = part.strip().partition("-")
            numbers.extend(range(int(first), min(int(last or first), int(first) + _MOST) + 1))
    except ValueError:
        numbers = []
    if not 0 < len(numbers) <= _MOST:
        raise ConfigurationError(
            "expected a list such as 1,5,10-12", where=Option("settings", text), code="not-a-list"
        )
    return tuple(dict.fromkeys(numbers))
