"""One run: what was read, fitted and assessed, and all that is asked of it.

Every figure that people or programs see is a row of its tables or a method of it; nothing computes
one again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.adjustment.force_at import Sine, fastest_sine, has_lost_errors, open_limits
from damperfit.damper.model import Model
from damperfit.errors import ConfigurationError, did_you_mean, refuse_wrong_arguments
from damperfit.identification.outcome import Status
from damperfit.identification.sharing import of_settings
from damperfit.io.files import sha256_of
from damperfit.problem import Option, Problem, Words, note, warning
from damperfit.recording import Recording, natural_order
from damperfit.reporting.records import (
    all_in,
    checks_in,
    entries_in,
    failures_in,
    inside,
    number_in,
    problems_in,
)
from damperfit.settings_and_logs import (
    LogResult,
    SettingResult,
    Tested,
    api_function,
    errors_of,
    motions_in,
    numbers_in,
    segments_in,
)
from damperfit.simulation import Motion, SolverOptions
from damperfit.store import file_set, path_of
from damperfit.stored_run import PAGE, StoredRun
from damperfit.tables import files as table_files
from damperfit.tables.columns import TABLES, values_from
from damperfit.tables.files import LogSignals
from damperfit.tested.setting import Setting, label_of
from damperfit.uncertainty.speed_forces import SpeedForces
from damperfit.units.quantities import QuantityError, parse_quantity

if TYPE_CHECKING:
    import pandas as pd

    from damperfit.comparison.measured import MeasuredTest
    from damperfit.configuration.options import Configuration
    from damperfit.queries.settings import SettingForces
    from damperfit.reporting.sheet import Sheet


NOTEBOOK_COLUMNS = 100
_SAME = 1e-9  # 4.6bara and 460000 are one pressure, but for the last digit
_OF_FIT = ("adjusters", "rig", "conditioning", "identification", "simulation")  # sections
_OF_LOGS = ("start", "start_values", "profile", "hold_out", "hold_out_cycles")  # of a fit
_FAN = "fan"  # force against velocity of all settings
_SHOWN_FAILURES = 5
_WORDS = Words("damperfit.identify")


class Run(StoredRun):
    """What `identify` found, or `load` read: parameters by setting, with intervals and verdicts.

    It prints itself, and pickles with all its files.
    """

    @cached_property
    def name(self) -> str:
        """What people call it: its damper's of a fleet or in memory, else its folder's."""
        return self.title if self.place is None else table_files.title_of(self.place)

    @cached_property
    def tests(self) -> tuple[MeasuredTest, ...]:
        """The mean cycles of its logs as they were measured, one a motion that repeats."""
        from damperfit.comparison.measured import measured_tests

        facts = {str(log.get("log")): log for log in self.inputs}
        tests: list[MeasuredTest] = []
        for signals in self.signals:
            log = facts.get(signals.log, {})
            logged = number_in(log, "temperature_degC")
            temperature = math.nan if logged is None else logged
            tests += measured_tests(signals, segments_in(log), temperature=temperature)
        return tuple(tests)

    def row(self, setting: Setting) -> dict[str, Any]:
        """Return the row of a setting in the table of parameters; it must have one."""
        return self._row_of[setting]

    @cached_property
    def _row_of(self) -> dict[Setting, dict[str, Any]]:
        return {Setting.of(row["setting"]): row for row in self.rows("parameters")}

    # The settings

    @cached_property
    def settings(self) -> tuple[SettingResult, ...]:
        """The settings that have all parameters, rising."""
        tops: dict[Any, float] = {}
        for log in self.inputs:
            for _, _, speed in motions_in(log):
                tops[log.get("setting")] = max(speed, tops.get(log.get("setting"), 0.0))
        entries = {entry.get("setting"): entry for entry in entries_in(self.record, "uncertainty")}
        settings = []
        for row in sorted(self.rows("parameters"), key=lambda row: Setting.of(row["setting"])):
            cells = [(quantity.default, row.get(quantity.name)) for quantity in self.quantities]
            numbers = [default if cell is None else cell for default, cell in cells]
            if None in numbers:
                continue
            values = values_from(self.quantities, numbers)  # type: ignore[arg-type]
            setting = Setting.of(row["setting"])
            own, shared, covariance = errors_of(values, row, entries.get(setting.cell, {}))
            lost = [n for n in values.names if row.get(f"{n}_status") == Status.NOT_IDENTIFIABLE]
            limits = {n: (row.get(f"{n}_ci_low"), row.get(f"{n}_ci_high")) for n in lost}
            misfits = {n: float(row.get(f"{n}_misfit_se") or 0.0) for n in values.names}
            known = (own, shared, covariance, tops.get(setting.cell, math.inf))
            left_open = open_limits(values, limits)
            settings.append(SettingResult(setting, values, *known, left_open, misfits, row, self))
        return tuple(settings)

    @refuse_wrong_arguments("run.setting")
    def setting(self, setting: Setting | str | float) -> SettingResult:
        """Return one setting, by its label or number; a ConfigurationError where there is none."""
        wanted = (label_of(setting) or "").strip()
        if not wanted:
            given = "''" if isinstance(setting, str) else type(setting).__name__
            text = f"found {given}; expected a setting such as 10 or 'R12 C8'"
            raise ConfigurationError(text, subject="run.setting", code="not-a-setting")
        for result in self.settings:
            if result.label.casefold() == wanted.casefold():
                return result
        labels = [result.label for result in self.settings]
        text = f"no setting {wanted}; there are {', '.join(labels)}.{did_you_mean(wanted, labels)}"
        raise ConfigurationError(text, code="no-setting")

    @property
    def notes(self) -> tuple[Problem, ...]:
        """What a reader must know of the errors: where the fit gave none."""
        lost = [setting for setting, is_recorded in self._without_errors.items() if is_recorded]
        text = (
            "no errors are known of {settings}: no minimum was met, or it could not be judged; the "
            "forces have no interval"
        )
        return (note("no-errors", text, settings=of_settings(lost)),) if lost else ()

    @property
    def remarks_on_errors(self) -> tuple[Problem, ...]:
        """Settings whose errors the run should have, and has not."""
        lost = [setting for setting, is_recorded in self._without_errors.items() if not is_recorded]
        which = "all settings" if len(lost) == len(self.rows("parameters")) else of_settings(lost)
        text = (
            "errors and correlations of {settings} are missing in run.json: forces without "
            "intervals"
        )
        return (warning("lost-errors", text, settings=which),) if lost else ()

    @property
    def _without_errors(self) -> dict[Setting, bool]:
        """Settings without errors, and whether the record says that there are none."""
        failed = {failure.setting for failure in failures_in(self.record)}
        recorded = {
            entry.get("setting"): names
            for entry in entries_in(self.record, "uncertainty")
            if isinstance(names := entry.get("parameters"), list)
        }

        def is_recorded(result: SettingResult) -> bool:
            names = recorded.get(result.setting.cell)
            is_lost = names is not None and has_lost_errors(names, result.status)
            return is_lost or result.setting in failed

        return {s.setting: is_recorded(s) for s in self.settings if s.covariance is None}

    @cached_property
    def logs(self) -> tuple[LogResult, ...]:
        """The logs that were fitted or held out, by setting and name."""
        facts = {str(log.get("log")): log for log in self.inputs}
        read_off: dict[tuple[Setting, str], list[dict[str, Any]]] = {}
        for row in self.rows("characteristics"):
            read_off.setdefault((row["setting"], row["log"]), []).append(row)
        logs = []
        for row in self.rows("mse"):
            if not (name := row["log"]):
                continue
            own = read_off.get((row["setting"], name), ())
            numbers = (row["mse_percent"], row["noise_floor_percent"])
            role, of_log = row["role"] or "fitted", facts.get(name, {})
            logs.append(LogResult(row["setting"], name, role, *numbers, of_log, own, self))
        return tuple(sorted(logs, key=lambda log: (log.setting, natural_order(log.name))))

    def log_of(self, signals: LogSignals) -> LogResult:
        """Return the log of signals, also of one without a row of errors."""
        own = signals[:2]
        if log := next((log for log in self.logs if (log.setting, log.name) == own), None):
            return log
        facts = next((facts for facts in self.inputs if facts.get("log") == signals.log), {})
        rows = [row for row in self.rows("characteristics") if (row["setting"], row["log"]) == own]
        return LogResult(*own, "fitted", None, None, facts, rows, self)

    # The damper and its tests

    @cached_property
    def configuration(self) -> Configuration:
        """The user's configuration with the run's damper, at the temperature that was asked for.

        A ConfigurationError: the user declares another damper, that of the run cannot be used, or
        the damper does not follow a temperature.
        """
        from damperfit.configuration.loading import load_configuration

        given = self.configured(load_configuration(self._config), config=self._config)
        if self.declared_damper is None and self._config is None:
            text = "the damper of the run is not known: the paper's is assumed; declare yours"
            self._remarks.append(warning("damper-assumed", text))
        return with_temperature(given, self._temperature)

    @cached_property
    def own_configuration(self) -> Configuration:
        """Configuration of reading and fit without logs and starts, as far as it is known."""
        from damperfit.configuration.loading import load_configuration

        known = {name: inside(self.record, "configuration", name) for name in _OF_FIT}
        sections = {  # JSON has no infinity: null is the default
            name: {key: value for key, value in section.items() if value is not None}
            for name, section in known.items()
            if isinstance(section, dict)
        }
        for key in _OF_LOGS:
            sections.get("identification", {}).pop(key, None)
        return load_configuration(overlay=sections | {"damper": self.declared_damper or {}})

    @property
    def shown_speeds(self) -> tuple[float, ...]:
        """The speeds at which forces are shown, m/s: ``output.speeds`` of the run."""
        speeds = inside(self.record, "configuration", "output", "speeds")
        with suppress(QuantityError, TypeError):
            return tuple(sorted(parse_quantity(speed, "velocity") for speed in speeds or ()))
        return ()

    @property
    def damper(self) -> Model:
        """Geometry, oil, gas and law."""
        return self.configuration.damper

    @property
    def solver(self) -> SolverOptions:
        """How exactly the model is integrated."""
        return self.configuration.simulation.solver

    @cached_property
    def declared_damper(self) -> Mapping[str, Any] | None:
        """Its [damper], as it was written; None: not known."""
        dampers = (inside(of, "configuration", "damper") for of in (self.record, self.facts))
        return next((damper for damper in dampers if isinstance(damper, dict)), None)

    @property
    def source(self) -> str:
        """Where damper and motion are recorded, for people."""
        if self._stored is None:
            return self._source
        is_in_record = isinstance(inside(self.record, "configuration", "damper"), dict)
        places = [self._stored / f"parameters.{suffix}" for suffix in ("parquet", "csv")]
        table = next(filter(Path.is_file, places), self._stored)
        return str(self._stored / "run.json" if is_in_record else table)

    def configured(
        self, given: Configuration, *, config: Path | None = None, takes_motion: bool = False
    ) -> Configuration:
        """Return a configuration of the user with the run's damper.

        ``config`` is the file it came from; with ``takes_motion`` the nominal test becomes the
        run's, unless one was declared. Another damper than the user's is a ConfigurationError.
        """
        from damperfit.configuration.damper_section import damper_of_record

        if self.declared_damper is None:
            names = {quantity.name for quantity in self.quantities}
            if any(q.default is None and q.name not in names for q in given.damper.quantities):
                text = (
                    "its parameters are not those of the model {model}, and it does not say of "
                    "which damper they are; give {--config FILE} with its [damper]"
                )
                model = given.damper.name
                raise ConfigurationError(text, subject=self.source, model=model, code="no-damper")
            return given
        try:
            own = damper_of_record(self.declared_damper)
        except ConfigurationError as error:
            if config is not None:
                return given
            raise ConfigurationError(
                f"the damper in {self.source} cannot be used ({error}); give {{config}}",
                config=Option("config"),
                code="damaged",
            ) from error
        self._refuse_other_damper(given, own, config)
        keys = {f"damper.{key}" for key in self.declared_damper}
        made = replace(given.with_damper(own), declared=given.declared | keys)
        if not takes_motion:
            return made
        motion = self.motion_of_tests
        rig = inside(self.record, "configuration", "rig")
        if motion is None and isinstance(rig, dict) and {"amplitude", "frequency"} <= rig.keys():
            size = parse_quantity(rig["amplitude"], "length")
            motion = Sine(size, parse_quantity(rig["frequency"], "frequency"))
        if motion is None:
            return made
        sine = {"amplitude": motion.amplitude, "frequency": motion.frequency}
        taken = {key: value for key, value in sine.items() if f"rig.{key}" not in given.declared}
        document = made.document | {"rig": made.document["rig"] | taken}
        return replace(made, rig=made.rig.but(**taken), document=document)

    def _refuse_other_damper(self, given: Configuration, own: Model, config: Path | None) -> None:
        if given.damper.name != own.name:
            if "damper.model" not in given.declared:
                return
            option = "model" if config is None else "config"
            raise ConfigurationError(
                f"damper.model is {given.damper.name}, but the parameters of {self.source} are of "
                f"{own.name}; leave {{option}} out, or run identify again with it",
                option=Option(option),
                where=Option(option, config or ""),
                code="other-model",
            )
        for name, (_, _, unit) in own.ranges.items():
            asked, fitted = getattr(given.damper, name), getattr(own, name)
            is_declared = f"damper.{name}" in given.declared
            if is_declared and not math.isclose(asked, fitted, rel_tol=_SAME):
                declared, own_text = (f"{value:g} {unit}".rstrip() for value in (asked, fitted))
                raise ConfigurationError(
                    f"damper.{name} is {declared}, but the parameters of {self.source} were "
                    f"fitted with {own_text} and hold for that damper alone; leave {{config}} out, "
                    "or run identify again with it",
                    config=Option("config"),
                    where=Option("config", config),
                    code="other-damper",
                )

    @property
    def _fitted_inputs(self) -> list[dict[str, Any]]:
        """Entries of the logs of the settings that have parameters."""
        cells = {result.setting.cell for result in self.settings}
        return [log for log in self.inputs if "setting" not in log or log["setting"] in cells]

    @property
    def motion_of_tests(self) -> Sine | None:
        """The fastest motion of the logs that were fitted, as far as it is known."""
        motions = [motion for log in self._fitted_inputs for motion in motions_in(log)]
        return fastest_sine(motions) if motions else None

    @cached_property
    def motion(self) -> Sine:
        """The fastest motion of the logs that were fitted, else the nominal one, with a remark."""
        if (tested := self.motion_of_tests) is not None:
            return tested
        text = "the motion of the test is not known: the nominal one is used"
        self._remarks.append(warning("motion-assumed", text))
        return Sine(self.configuration.rig.amplitude, self.configuration.rig.frequency)

    @cached_property
    def tested(self) -> Tested:
        """The range of the tests that were fitted."""
        logs = self._fitted_inputs
        segments = [segment for log in logs for segment in segments_in(log)]
        rates = numbers_in(segments, "frequency_Hz")
        speeds = numbers_in(segments, "peak_speed_m_per_s")
        speeds = speeds or [speed for log in logs for _, _, speed in motions_in(log)]
        warm = numbers_in(logs, "temperature_degC")
        return Tested(
            len(logs),
            max(numbers_in(segments, "amplitude_m"), default=None),
            max(speeds, default=None),
            (min(rates), max(rates)) if rates else None,
            (min(warm), max(warm)) if warm else None,
        )

    @property
    def identity(self) -> dict[str, str]:
        """Whose test it was: what is known of damper, serial, customer, operator, date, rig."""
        test = self.record.get("test")
        items = test.items() if isinstance(test, dict) else ()
        return {str(key): value for key, value in items if isinstance(value, str) and value}

    @cached_property
    def speed_forces(self) -> tuple[SpeedForces, ...]:
        """Measured forces at the named speeds, and what the model misses; older runs: none."""
        read = all_in(self.record, "speed_forces", SpeedForces)
        names = ("measured", "measured_se", "difference", "misfit")
        # The record says settings by their labels; that of several adjusters is more than its own.
        tested = {forces.setting.cell: forces.setting for forces in self.settings}
        return tuple(
            replace(forces, setting=tested.get(forces.setting.cell, forces.setting))
            for forces in read
            if {len(forces.speeds)} >= {len(getattr(forces, name)) for name in names}  # whole
        )

    @property
    def digest(self) -> str:
        """SHA-256 of the table of parameters, as it would be written where it stands nowhere."""
        if self.place is None:
            return table_files.sha256_of_table(self.table("parameters"))
        paths = (
            [table_files.part_in(self.place, [])]
            if table_files.is_part(self.place)
            else [self.place]
        )
        if self._stored is not None:
            paths = [self.place / f"parameters{suffix}" for suffix in (".parquet", ".csv")]
        return next((sha256_of(path) for path in paths if path.is_file()), "")

    # For people: frames, figures, text

    @property
    def parameters(self) -> pd.DataFrame:
        """One row a setting: values, standard errors, 95 % intervals, status, MSE, grade; SI."""
        return self.frame("parameters")

    @property
    def mse(self) -> pd.DataFrame:
        """One row a setting and log."""
        return self.frame("mse")

    @property
    def characteristics(self) -> pd.DataFrame:
        """What is read off each segment: peaks and named speeds, measured beside simulated."""
        return self.frame("characteristics")

    @property
    def forces(self) -> pd.DataFrame:
        """Force by setting, speed and stroke, with its interval and what a click changes."""
        return self.frame("adjustment")

    @property
    def clicks(self) -> pd.DataFrame:
        """The rows of `forces` with the change from the setting before."""
        table = self.forces
        return table[table["change_N"].notna()].reset_index(drop=True)

    @property
    def energy(self) -> pd.DataFrame:
        """Energy of a cycle, J, by setting, log and segment."""
        table = self.characteristics
        columns = ("setting", "log", "stretch", "frequency_Hz", "amplitude_m")
        figures = ("measured_energy_J", "measured_energy_se_J", "simulated_energy_J")
        rows = table[table["point"] == "peak"].reset_index(drop=True)
        return rows[[name for name in (*columns, *figures) if name in rows]]

    @property
    def traces(self) -> pd.DataFrame:
        """Signals over time by setting and log, measured and simulated."""
        return self.frame("responses")

    @property
    def residuals(self) -> pd.DataFrame:
        """Measured less simulated force over time, N, by setting and log."""
        table = self.traces
        left = table[["setting", "log", "time_s", "displacement_m", "velocity_m_per_s"]]
        return left.assign(residual_N=table["force_measured_N"] - table["force_N"])

    def profile(self, name: str) -> pd.DataFrame:
        """Return the profile of a parameter that `identify` was asked for, by setting."""
        profiles = self.frame("profiles") if self._has("profiles") else None
        names = [] if profiles is None else sorted(set(profiles["parameter"]))
        if profiles is None or name not in names:
            there = f"there are {', '.join(names)}" if names else "give identify profile=[...]"
            raise ConfigurationError(f"no profile of {name!r}; {there}", code="no-profile")
        return profiles[profiles["parameter"] == name].reset_index(drop=True)

    def which_setting(
        self, force: str | float, speed: str | float, stroke: str | None = None
    ) -> SettingForces:
        """Return which setting gives a force at a speed, as ``900`` N at ``"0.2m/s"``.

        A bare number is SI; a minus before one of them means compression, and so does the
        ``stroke`` "bump".
        """
        forces: SettingForces = api_function("settings")(
            self, force=force, velocity=speed, stroke=stroke
        )
        return forces

    def predict(
        self, log: str | Path | Recording, setting: Setting | str | float | None = None
    ) -> pd.DataFrame:
        """Return what a setting predicts of a log that was not fitted, over time.

        The log, a path or a Recording, is conditioned as those of the run were, and the model's
        force filtered alike; ``attrs["mse_percent"]`` is the normalised MSE, eq. (22), of the
        compared samples. The values are those of the setting that the log says by default.
        """
        import pandas as pd

        from damperfit.conditioning.log_to_trace import condition
        from damperfit.identification.logs import compare, normalised_mse
        from damperfit.io import read_log
        from damperfit.recording import Recording

        own = self.own_configuration
        recording = log if isinstance(log, Recording) else read_log(Path(log), own.reading)
        if setting is None and recording.setting is None:
            raise ConfigurationError(
                "run.predict: the log says no setting; give setting=N", code="no-setting"
            )
        setting = recording.setting if setting is None else setting
        values = self.setting(setting).values  # type: ignore[arg-type]
        trace = condition(recording, own.conditioning)
        compared = compare(values, trace, self.damper, solver=self.solver)
        part = trace.compared
        columns = {
            "time_s": compared.response.time[part],
            "displacement_m": trace.displacement[part],
            "velocity_m_per_s": trace.velocity[part],
            "force_measured_N": trace.force[part],
            "force_N": compared.force[part],
        }
        table = pd.DataFrame(columns)
        table.attrs["mse_percent"] = normalised_mse(trace.force[part], compared.force[part])
        return table

    @property
    def covariance(self) -> pd.DataFrame:
        """Covariance of the values by setting, SI; ``attrs["units"]`` has their units."""
        return self._matrices(is_correlation=False)

    @property
    def correlations(self) -> pd.DataFrame:
        """Correlations of the values by setting."""
        return self._matrices(is_correlation=True)

    def _matrices(self, *, is_correlation: bool) -> pd.DataFrame:
        import pandas as pd

        blocks = {}
        for result in self.settings:
            if result.covariance is None or not len(result.covariance):
                continue
            scales = np.sqrt(np.diag(result.covariance))
            if not is_correlation:
                values = result.values
                pairs = [(values.quantity(name), values[name]) for name in result.names]
                scales = np.array([1.0 / y if of.is_logarithmic else 1.0 for of, y in pairs])
            with np.errstate(divide="ignore", invalid="ignore"):
                matrix = result.covariance / np.outer(scales, scales)
            blocks[result.label] = pd.DataFrame(matrix, result.names, result.names)
        table = pd.concat(blocks, names=["setting", "parameter"]) if blocks else pd.DataFrame()
        if blocks:
            table.attrs["units"] = {quantity.name: quantity.unit for quantity in self.quantities}
        return table

    @property
    def failed(self) -> tuple[Problem, ...]:
        """Logs and settings without a result."""
        return tuple(failure.placed for failure in failures_in(self.record))

    @property
    def warned(self) -> tuple[Problem, ...]:
        """What to know before believing the numbers; of older runs their sentences."""
        return (*self.remarks, *problems_in(self.record))

    @property
    def problems(self) -> tuple[Problem, ...]:
        """What failed, what to know before believing the numbers, and checks that did not pass."""
        unmet = (check for check in checks_in(self.record) if check.passed is False)
        checks = (Problem("failed-check", check.reason, subject=check.name) for check in unmet)
        return (*self.failed, *self.warned, *checks)

    @property
    def failures(self) -> tuple[str, ...]:
        """Logs and settings without a result, a sentence each."""
        return tuple(problem.sentence(_WORDS) for problem in self.failed)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before believing the numbers, a sentence each."""
        return tuple(problem.sentence(_WORDS) for problem in self.warned)

    @property
    def checks(self) -> pd.DataFrame:
        """The checklist."""
        import pandas as pd

        return pd.DataFrame(self.record.get("checks", []))

    def frame(self, name: str = "parameters") -> pd.DataFrame:
        """Return a table, as "parameters", "mse" or "adjustment"; ``attrs["units"]`` by column."""
        import pandas as pd

        name = str(name)
        if name in TABLES:  # it is there, or lost
            _ = self.signals if name == "responses" else self.rows(name)
        there = [table for table in TABLES if self._has(table)]
        if name in there and self.place is not None and self._stored is None:
            return pd.DataFrame(
                [{**row, "setting": row["setting"].cell} for row in self.rows(name)]
            )
        if name in there and (name != "responses" or self.signals):
            table = self.table(name)
            frame: pd.DataFrame = table.to_pandas()
            units = ((field.name, field.metadata.get(b"unit", b"")) for field in table.schema)
            frame.attrs["units"] = {column: unit.decode() for column, unit in units if unit}
            return frame
        tables = f"there {'are ' if there else 'is none'}{', '.join(there)}"
        text = f"no table {name!r} in these results; {tables}.{did_you_mean(name, there)}"
        raise ConfigurationError(text, code="no-table")

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters as a data frame."""
        return self.parameters

    def simulate(
        self, setting: Setting | str | float, wave: str | Motion | None = None, **motion: Any
    ) -> Any:
        """Simulate a setting; a wave, a `Motion`, keywords as of `damperfit.simulate`."""
        return self.setting(setting).simulate(wave, **motion)

    def sensitivity(self, setting: Setting | str | float, motion: Motion) -> pd.DataFrame:
        """Return the force of a setting along a motion and its slopes, as `SettingResult` does."""
        return self.setting(setting).sensitivity(motion)

    def advise(self, for_: str, **limits: Any) -> Any:
        """Say which further test narrows an interval most; keywords as of `damperfit.advise`."""
        return api_function("advise")(self, for_=for_, **limits)

    def ride(self, **how: Any) -> Any:
        """Return comfort and wheel load by setting; keywords as of `damperfit.ride`."""
        return api_function("ride")(self, **how)

    def valves(self, **how: Any) -> Any:
        """Return the valves as parts; keywords as of `damperfit.valves`."""
        return api_function("valves")(self, **how)

    def plot(self, name: str | None = None) -> Any:
        """Draw a figure with matplotlib and return its axes, a list where it has several panels.

        The name is as of the files of `damperfit report --figures`; by default force against
        velocity of all settings.
        """
        from damperfit.reporting.drawing import compose, fixed_style
        from damperfit.reporting.figures import report_plots

        plots = {plot.name: plot for plot in report_plots(self).plots}
        chosen = _FAN if name is None else str(name)
        if chosen not in plots:
            hint = did_you_mean(chosen, plots)
            text = f"no figure {chosen!r}; there are {', '.join(plots)}.{hint}"
            raise ConfigurationError(text, code="no-figure")
        with fixed_style():
            axes = compose(plots[chosen]).axes
        return axes[0] if len(axes) == 1 else list(axes)

    def report(self, path: str | Path = PAGE) -> Path:
        """Write the page and return where it is."""
        from damperfit.reporting.figures import report_plots
        from damperfit.reporting.page import html_report

        text = html_report(report_plots(self), title=self.title)
        whole = path_of(path, "run.report", "the path of a page")
        with file_set(whole.parent) as files:
            files.path(whole.name).write_bytes(text.encode("utf-8", "backslashreplace"))
        return whole

    @property
    def title(self) -> str:
        """Whose run it is, in a word."""
        return self.identity.get("serial") or self.identity.get("damper") or "damperfit"

    def _sheet(self) -> Sheet:
        from damperfit.reporting.tables import parameter_sheet

        return parameter_sheet(self.rows("parameters"), self.quantities)

    @property
    def _headline(self) -> str:
        from damperfit.reporting.report import lead

        whose = f"damper {self.title}, " if self.title != "damperfit" else ""
        failed = f" {len(self.failures)} failed." if self.failures else ""
        return f"Run: {whose}{lead(self)}{failed}"

    @property
    def _unmet(self) -> tuple[str, ...]:
        """What failed, and checks that did not pass, a line each."""
        from damperfit.reporting.tables import check_lines

        return (*self.failures[:_SHOWN_FAILURES], *check_lines(checks_in(self.record))[1:])

    def __repr__(self) -> str:
        from damperfit.reporting.sheet import text_table

        table = text_table(self._sheet(), NOTEBOOK_COLUMNS)
        return "\n".join((self._headline, table, *self._unmet))

    def _repr_html_(self) -> str:
        from damperfit.reporting.sheet import html_table
        from damperfit.reporting.tables import check_sheet, check_summary

        checks = checks_in(self.record)
        failed = "".join(f"<p>{escape(line)}</p>" for line in self.failures[:_SHOWN_FAILURES])
        shown = html_table(self._sheet(), caption=self._headline) + failed
        if checks:
            shown += html_table(check_sheet(checks), caption=check_summary(checks))
        return shown


def with_temperature(configuration: Configuration, temperature: str | None) -> Configuration:
    """Return the configuration with its damper at a temperature, as typed; None: as it is."""
    from damperfit.damper.temperature_law import at_temperature

    if temperature is None:
        return configuration
    try:
        asked = parse_quantity(temperature, "temperature")
    except ValueError as error:
        where = Option("temperature", temperature)
        raise ConfigurationError(f"{error}", where=where, code="wrong-value") from error
    return replace(configuration, damper=at_temperature(configuration.damper, asked))
