"""Simulations of one setting: whose parameters, which motion, one test or a sweep."""

import math
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from damperfit.adjustment.between import Interpolated, values_between
from damperfit.configuration.options import Configuration, parameter_value
from damperfit.damper.model import Model, Quantity, Values
from damperfit.damper.purdy.parameters import (
    FAMILIES,
    PURDY_DAMPER,
    REFERENCE_SOURCE,
    Damper,
    reference_parameters,
)
from damperfit.damper.temperature_law import BETA, WithTemperature
from damperfit.errors import (
    ConfigurationError,
    DamperfitError,
    InternalError,
    SimulationError,
    did_you_mean,
    failure_of,
)
from damperfit.identification.sharing import unlimited_in, values_from_others
from damperfit.io import read_log
from damperfit.problem import Option, Problem, in_a_row, listed_names, warning
from damperfit.recording import Trace
from damperfit.results import Run
from damperfit.run.logs import Labels, conditioned_as_tested, facts_of
from damperfit.settings_and_logs import SettingResult, Tested
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
from damperfit.tested.setting import ADJUSTER, Setting, parse_setting

# The parameters that a test is simulated with, and their origin

_WARMER = 1.0  # K; so much a log drifts by itself
_TABLES = ("parameters.parquet", "parameters.csv")


@dataclass(frozen=True, slots=True)
class ChosenParameters:
    """Parameters and where they came from."""

    parameters: Values  # SI
    setting: Setting | None  # adjuster setting, None when all parameters were given one by one
    source: str  # one sentence for people
    run: Run | None = None  # their run; None: the reference set, or all were given
    unlimited: tuple[str, ...] = ()  # those to which the logs of their setting set no upper limit
    fitted: SettingResult | None = None  # None where values were replaced
    between: Interpolated | None = None  # of a setting that was not tested, beside two that were

    @property
    def tested(self) -> Tested:
        """What the logs of the run covered."""
        return Tested() if self.run is None else self.run.tested

    def warnings(
        self, speed: float, temperature: float | None = None, **motion: float
    ) -> tuple[Problem, ...]:
        """Warnings on a force at a motion (keywords of `Tested.outside`) and temperature, degC."""
        run, names, outside = self.run, listed_names(self.unlimited), self.tested.outside
        warned = [problem.of(run.shown_as) for problem in run.remarks] if run else []
        if beyond := ", ".join(outside(speed=speed, **motion)):
            text = "never tested: {what}; there the force is extrapolated"
            warned.append(warning("never-tested", text, what=beyond))
        if temperature is not None and self.tested.temperatures is not None:
            low, high = self.tested.temperatures
            if temperature < low - _WARMER or temperature > high + _WARMER:
                text = (
                    f"the tests were at {low:.3g} to {high:.3g} degC; beyond that the viscosity is "
                    "extrapolated"
                )
                warned.append(warning("never-tested", text, f"{temperature:.3g} degC"))
        if names and run and all(fit.setting != self.setting for fit in run.settings):
            text = (
                "the logs of the settings that it is put together from set no upper limit, so "
                "these forces may be far off; fit a log of this setting, or replace the value"
            )
            warned.append(warning("no-upper-limit", text, f"{names} at setting {self.setting}"))
        elif names and any(outside(speed=speed)):
            text = (
                f"the logs of setting {self.setting} set no upper limit, so the force beyond their "
                "speeds may be far off"
            )
            warned.append(warning("no-upper-limit", text, names))
        return tuple(warned)


def choose_parameters(
    setting: Setting | int | str | None,
    *,
    table: Path | Run | None,
    replaced: Mapping[str, str],
    folder: Path = Path("results"),
    damper: Model = PURDY_DAMPER,
) -> ChosenParameters:
    """Return the parameters to simulate with."""
    if all(quantity.name in replaced for quantity in damper.quantities if quantity.default is None):
        if table is not None:
            raise ConfigurationError(
                "nothing is taken from it, as {--set} gives all parameters; leave one out",
                where=Option("parameters", table),
                code="no-effect",
            )
        parameters = damper.values(_replaced(damper.quantities, replaced))
        chosen = None if setting is None else _setting_named(setting)
        return ChosenParameters(parameters, chosen, "parameters: all given")
    settle(folder)
    if table is None and any((folder / name).exists() for name in _TABLES):
        table = folder
    run = None if table is None else Run.load(table, parts=("parameters",))
    quantities = damper.quantities if run is None else run.quantities
    values = _replaced(quantities, replaced)
    if setting is None:
        missing = [q.name for q in quantities if q.default is None and q.name not in values]
        raise ConfigurationError(
            f"no parameters for {', '.join(missing)}: give {{--setting N}} or {{--set}} them all",
            code="no-parameters",
        )
    if run is not None:
        choice = _of_run(run, setting, values)
    elif damper.name != PURDY_DAMPER.name:
        raise ConfigurationError(
            f"there is no reference set of the model {damper.name!r}: give {{--parameters FILE}}, "
            "or all of them by {--set}",
            code="no-parameters",
        )
    else:
        chosen = _setting_named(setting)
        if isinstance(chosen.cell, str):
            raise ConfigurationError(
                "not in the reference set; expected a whole number, 1 to 20",
                where=Option("setting", setting),
                code="unknown-setting",
            )
        source = f"setting {chosen} of the {REFERENCE_SOURCE}"
        choice = ChosenParameters(reference_parameters(chosen.cell), chosen, source)
    suffix = f"; replaced: {', '.join(values)}" if values else ""
    source = f"parameters: {choice.source}{suffix}"
    return replace(choice, parameters=choice.parameters.replace(values), source=source)


def _of_run(
    run: Run, setting: Setting | int | str, replaced: Mapping[str, float]
) -> ChosenParameters:
    path = run.shown_as
    results = {result.setting: result for result in run.settings}
    values = {result.setting: result.parameters for result in run.settings}
    unlimited = {result.setting: frozenset(result.unlimited) for result in run.settings}
    chosen = _setting_named(setting, results)
    source, fitted, curve = f"setting {chosen} of {path}", results.get(chosen), None
    if fitted is None:
        parameters = values_from_others(values, chosen)
        if parameters is not None:
            names = frozenset(unlimited_in(parameters, values, unlimited))
            source = f"setting {chosen}, put together from the clicks of the settings of {path}"
        elif (curve := values_between(run.damper, run.settings, chosen)) is not None:
            parameters, neighbours = curve.values, [stage.setting for stage in curve.neighbours]
            names = frozenset(name for setting in neighbours for name in unlimited[setting])
            source = (
                f"setting {chosen}, not tested, its values between those of "
                f"{in_a_row(list(map(str, neighbours)))} of {path}"
            )
        else:
            listed = ", ".join(str(number) for number in sorted(results)) or "none"
            raise ConfigurationError(
                f"no parameters of setting {chosen}; there are {listed}; one in between is "
                "simulated where three of its adjuster were tested, the others held",
                subject=path,
                code="unknown-setting",
            )
    else:
        parameters, names = fitted.parameters, unlimited[chosen]
    unlimited_names = tuple(n for n in parameters.names if n in names and n not in replaced)
    origin = (None, None) if replaced else (fitted, curve)
    return ChosenParameters(parameters, chosen, source, run, unlimited_names, *origin)


def _replaced(quantities: Sequence[Quantity], texts: Mapping[str, str]) -> dict[str, float]:
    table = {quantity.name: quantity for quantity in quantities}
    for name in texts:
        if name not in table:
            raise ConfigurationError(
                f"no parameter {name!r}; there are {', '.join(table)}.{did_you_mean(name, table)}",
                code="unknown-parameter",
            )
    return {name: parameter_value(table[name], text) for name, text in texts.items()}


def _setting_named(setting: Setting | int | str, among: Collection[Setting] = ()) -> Setting:
    """The setting that a label names, if possible one of `among`."""
    if not isinstance(setting, str):
        return Setting.of(setting)
    by_label = {tested.label.casefold(): tested for tested in among}
    adjusters = next(iter(among)).adjusters if among else (ADJUSTER,)
    try:
        return by_label.get(setting.strip().casefold()) or parse_setting(setting, adjusters)
    except ValueError as error:
        raise ConfigurationError(
            f"{error}", where=Option("setting", setting), code="unknown-setting"
        ) from error


def damper_of(
    choice: ChosenParameters, configuration: Configuration, *, config: Path | None = None
) -> tuple[Configuration, str]:
    """Return the configuration with the damper that the parameters belong to, and a line on it."""
    line = configuration.damper_sentence()
    if choice.run is not None:
        configuration, line = _damper_of_run(choice.run, configuration, config)
    lacks_beta = BETA.name not in choice.parameters.names
    if lacks_beta and isinstance(configuration.damper, WithTemperature):
        raise ConfigurationError(
            f"damper.reference_temperature: setting {choice.setting} of "
            f"{choice.run.shown_as if choice.run else 'the reference set'} has no beta; leave the "
            "key out, or take results of identify with {--covariate temperature}",
            code="no-temperature",
        )
    return configuration, line


def _damper_of_run(
    run: Run, configuration: Configuration, config: Path | None
) -> tuple[Configuration, str]:
    configuration = run.configured(configuration, config=config, takes_motion=True)
    line = f", that of {run.source}"
    if run.declared_damper is None:
        line = f"; {run.source} does not say whose parameters these are"
    schema = unknown_schema(run.record)
    return configuration, configuration.damper_sentence(f"{line}; {schema}" if schema else line)


def truth_of(
    results: Path | Run, configuration: Configuration, config: Path | None
) -> tuple[dict[int, Values], Configuration, str]:
    """Return the values of a table, and the configuration and line of the damper they hold for."""
    run = Run.load(results, parts=("parameters",))
    by_cell = {result.setting.cell: result.values for result in run.settings}
    truth = {setting: values for setting, values in by_cell.items() if isinstance(setting, int)}
    return truth, *_damper_of_run(run, configuration, config)


# One simulated test

# A cycle: at 33 the force at 0.05 m/s is up to 50 N off, at 333 half a newton.
FEW_SAMPLES = 200
_PILOT_SAMPLES = 100  # of one cycle: the integrator's own steps are more
_WAVES = {"sine": sine_motion, "triangle": triangle_motion}


def simulated(
    parameters: Values, configuration: Configuration, *, log: Path | None = None
) -> tuple[str, float, Response, Response, Characteristics]:
    """Simulate a test with a wave, or with the displacement of a log.

    Returned are what drove the damper, for people, cycles per second, all signals, those up to the
    end of the last steady cycle, and figures of that cycle.
    """
    rig, options, damper = configuration.rig, configuration.simulation, configuration.damper
    if log is None:
        refuse_amplitude(rig.amplitude, damper.travel)
        _refuse_work(parameters, configuration)
        motion = _WAVES[options.wave](
            rig.amplitude, rig.frequency, cycles=options.cycles, sample_rate=options.sample_rate
        )
        words = (
            f"{options.wave} of {1e3 * rig.amplitude:.4g} mm at {rig.frequency:.4g} Hz, "
            f"last of {options.cycles:g} cycles"
        )
        response = steady = simulate(parameters, damper, motion, options=options.solver)
        frequency = rig.frequency
    else:
        trace = _trace(log, configuration)
        motion, frequency = motion_of(trace), trace.frequency
        temperature = getattr(damper, "temperature", None)
        if temperature is not None:  # before what the log says
            motion = replace(motion, temperature=temperature)
        response = simulate(parameters, damper, motion, options=options.solver)
        signals = ("time", "displacement", "velocity", "force", "pressures", "masses")
        cycle = {name: getattr(response, name)[..., trace.fastest.window] for name in signals}
        steady = replace(response, **cycle)
        words = f"displacement of {trace.name}, last of {trace.fastest.n_cycles} steady cycles"
    figures = characterise(steady, frequency, speeds=configuration.output.speeds)
    if log is None and options.wave == "triangle":
        # It holds one speed a stroke: what lies below is passed in the jump, between two samples.
        figures = replace(
            figures, speed_forces=(), hysteresis_rebound=math.nan, hysteresis_bump=math.nan
        )
    return words, frequency, response, steady, figures


def _trace(log: Path, configuration: Configuration) -> Trace:
    try:
        recording = read_log(log, configuration.reading.but(needs_force=False))
        if not recording.force.any():  # time and displacement alone: any damping shows the cycles
            force = 1e5 * np.gradient(recording.displacement)
            recording = replace(recording, force=force, reverse_force=False)
        row = Labels([log], configuration).row(log)
        facts, _ = facts_of(recording, log, configuration, row)
        return conditioned_as_tested(recording, configuration.conditioning, facts)
    except (DamperfitError, MemoryError):
        raise
    except Exception as error:
        failure = failure_of(error, f"reading {log.name}")
        raise InternalError(failure.message) from error


def _refuse_work(parameters: Values, configuration: Configuration) -> None:
    """Estimate samples and steps before any are made, the steps from one cycle."""
    rig, options = configuration.rig, configuration.simulation
    n_steps = n_samples = options.cycles * options.sample_rate / rig.frequency
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
            "(simulation.max_steps); take fewer {--cycles} or a lower {--sample-rate}, or allow "
            f"more with {{--max-steps {math.ceil(1.1 * n_steps)}}}",
            code="too-much-work",
        )


# One quantity scaled by factors, all others fixed: the families of the paper's Figs 4-9


class Variation(NamedTuple):
    """What is varied, one of `swept_units`, by which factors in the order given."""

    name: str
    factors: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class SweepMember:
    """One test of a sweep."""

    factor: float
    value: float  # the quantity that the factor makes, SI
    frequency: float  # Hz
    response: Response
    figures: Characteristics  # of the last cycle

    @property
    def cavitation(self) -> float:
        """Largest share of the cycle that a chamber is at zero pressure."""
        return max(self.figures.cavitation_shares)

    @property
    def last_cycle(self) -> slice:
        """The samples of the last cycle."""
        time = self.response.time
        start = int(np.searchsorted(time, time[-1] - 1.0 / self.frequency))
        return slice(max(0, start - 1), len(time))


_GAS = {"p_0": "gas_pressure", "gamma": "gas_exponent"}
PAPER_SWEEPS = tuple(Variation(family.name, family.factors) for family in FAMILIES)


def swept_units(damper: Model) -> dict[str, str]:
    """Return what of a damper and its test can be varied, with units.

    Of the paper's damper the gas too, which is a quantity of other dampers with gas.
    """
    gas = {"p_0": "Pa", "gamma": ""} if isinstance(damper, Damper) else {}
    units = {quantity.name: quantity.unit for quantity in damper.quantities}
    return units | gas | {"amplitude": "m", "frequency": "Hz"}


def parse_variation(text: str, damper: Model = PURDY_DAMPER) -> Variation:
    """Return the variation that NAME=F1,F2,... means.

    Examples
    --------
    >>> parse_variation("P_0=0.5,1,2")
    Variation(name='p_0', factors=(0.5, 1.0, 2.0))
    """

    def wrong(sentence: str, code: str) -> ConfigurationError:
        return ConfigurationError(sentence, where=Option("vary", text), code=code)

    name, equals, factors = (part.strip() for part in text.partition("="))
    name, units = name.lower(), swept_units(damper)
    if not (name and equals and factors):
        example = f"{damper.names[0]}=0.8,1,1.2"
        raise wrong(f"expected NAME=F1,F2,..., as in {example}", "not-a-variation")
    if name not in units:
        listed, hint = ", ".join(units), did_you_mean(name, units)
        raise wrong(f"no {name!r}; there are {listed}.{hint}", "unknown-name")
    values: list[float] = []
    for part in factors.split(","):
        try:
            values.append(float(part))
        except ValueError as error:
            raise wrong(f"{part!r} is not a number", "not-a-number") from error
        if not 0.0 <= values[-1] < math.inf:
            raise wrong(f"{part}: expected a factor of 0 or more", "out-of-range")
    may_be_zero = [q.name for q in damper.quantities if q.may_vanish or q.is_offset]
    if min(values) == 0.0 and name not in may_be_zero:
        raise wrong(f"{name} times 0 is not a damper; give factors above 0", "not-a-damper")
    if len(set(values)) < len(values):
        raise wrong("a factor is given twice", "given-twice")
    return Variation(name, tuple(values))


def run_sweep(
    parameters: Values, configuration: Configuration, *, variation: Variation
) -> tuple[SweepMember, ...]:
    """Simulate the nominal test once for each factor, in their order."""
    name = variation.name
    rig, damper = configuration.rig, configuration.damper
    if name in parameters.names:
        base = float(parameters[name])
    else:
        base = float(getattr(damper, _GAS[name]) if name in _GAS else getattr(rig, name))
    if base == 0.0:
        raise ConfigurationError(f"{name} is 0 here: no factor changes it", code="out-of-range")
    members = []
    for factor in variation.factors:
        value, varied, modified = base * factor, parameters, configuration
        try:
            if name in parameters.names:
                varied = parameters.replace({name: value})
            elif name in _GAS and isinstance(damper, Damper):
                modified = replace(configuration, damper=replace(damper, **{_GAS[name]: value}))
            else:
                modified = replace(configuration, rig=rig.but(**{name: value}))
        except ConfigurationError as error:
            raise ConfigurationError(
                "{error}",
                error=error,
                where=Option("vary", f"{factor:g}", name),
                code=error.problem.code,
            ) from error
        _, frequency, response, _, figures = simulated(varied, modified)
        members.append(SweepMember(factor, value, frequency, response, figures))
    return tuple(members)


# The list of settings of `samples`

_MOST = 1000  # settings; more is a slip of the keyboard


def numbers_in(text: str | Sequence[int]) -> tuple[int, ...]:
    """Return the settings that a list such as ``1,5,10-12`` names."""
    text = text if isinstance(text, str) else ",".join(map(str, text))
    try:
        numbers: list[int] = []
        for entry in text.split(","):
            low, _, high = entry.strip().partition("-")
            numbers.extend(range(int(low), min(int(high or low), int(low) + _MOST) + 1))
    except ValueError:
        numbers = []
    if not 0 < len(numbers) <= _MOST:
        raise ConfigurationError(
            "expected a list such as 1,5,10-12", where=Option("settings", text), code="not-a-list"
        )
    return tuple(dict.fromkeys(numbers))
