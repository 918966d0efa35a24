"""The result of a fleet run: sentence, JSON, and the table and page of all its parts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from damperfit.adjustment.force_at import STROKE_WORDS
from damperfit.fleets.parts import SUMMARY, collect
from damperfit.fleets.run import Done, State
from damperfit.problem import Problem, counted, note
from damperfit.reporting.answer import Answer
from damperfit.reporting.sheet import Sheet

if TYPE_CHECKING:
    from damperfit.comparison.tolerance import Tolerance
    from damperfit.fleets.survey import Survey, ToleranceCheck

_MANY = 20  # failures, or dampers, that are listed one by one; the parts hold them all
_LABELS = {
    State.FITTED: "fitted now",
    State.KNOWN: "done before",
    State.FAILED: "without any fit",
    State.LATER: "not done, tried again next time",
}


class FleetDone(Answer):
    """The result of a fleet run.

    `folder` holds the parts, `done` are the finished tasks of `n_tasks`. Where they were asked for,
    `n_rows` counts the rows of the table of all parts, `survey` is its evaluation, `page` the page.
    """

    def __init__(self, folder: Path, *, has_logs: bool) -> None:
        self.folder, self.has_logs = folder, has_logs
        self.done: list[Done] = []
        self.n_tasks, self.is_stopped = 0, False
        self.n_rows: int | None = None
        self.survey: Survey | None = None
        self.page: Path | None = None

    @property
    def check(self) -> ToleranceCheck | None:
        """The fleet compared with a tolerance, where one was given."""
        return None if self.survey is None else self.survey.check

    @property
    def counts(self) -> dict[str, int]:
        """Number of tasks by state."""
        return {state.value: sum(task.state is state for task in self.done) for state in State}

    @property
    def exit_code(self) -> int:
        """Exit code of the command; failures of earlier parts count like those of new ones."""
        if self.is_stopped:
            return 130
        if any(task.failures for task in self.done):
            return 1 if any(task.n_settings for task in self.done) else 3
        is_missed = self.check is not None and bool(self.check.missed)
        return 4 if is_missed or any(task.n_gates for task in self.done) else 0

    def collect(self, tolerance: Tolerance | None, *, is_reported: bool) -> None:
        """Make the table of all parts, compare its forces with a tolerance, write the page."""
        table = collect(self.folder)
        self.n_rows = table.num_rows
        if tolerance is None and not is_reported:
            return
        from damperfit.fleets.survey import survey

        self.survey = survey(table, tolerance)
        if is_reported:
            from damperfit.fleets.page import write_page

            self.page = write_page(self.folder / SUMMARY, self.survey)

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        from damperfit.reporting.compared import tolerance_rows

        check, survey = self.check, self.survey
        worst = () if check is None else check.worst

        def lines(name: str) -> list[dict[str, str]]:
            pairs = [(task.owner, item) for task in self.done for item in getattr(task, name)]
            return [{"damper": owner, "message": str(problem)} for owner, problem in pairs]

        return {
            "dampers": self.n_tasks,
            **self.counts,
            "logs": sum(task.n_logs for task in self.done),
            "settings": sum(task.n_settings for task in self.done),
            "interrupted": self.is_stopped,
            "failures": lines("failures"),
            "gates_missed": lines("gates"),
            "tolerance": None if check is None else check.source,
            "dampers_out_of_tolerance": [point.run for point in worst],
            "points": [] if check is None else tolerance_rows(check.missed),
            "capability": [] if survey is None else survey.capability,
            "shifts": [] if survey is None else list(survey.shifts),
            "run_rules": [] if survey is None else survey.rules,
        }

    def sheets(self) -> tuple[Sheet, ...]:
        """Return no table: it stands in the folder."""
        return ()

    @property
    def sentence(self) -> str:  # type: ignore[override]
        """Number of dampers by state, and those that are out of tolerance."""
        lines = []
        if self.has_logs:
            counts = [(self.counts[state.value], label) for state, label in _LABELS.items()]
            states = ", ".join(f"{n} {label}" for k, (n, label) in enumerate(counts) if n or not k)
            n_logs = sum(task.n_logs for task in self.done)
            settings = f"{sum(task.n_settings for task in self.done)} settings with a fit"
            dampers = counted(self.n_tasks, "damper")
            if (n := len({task.owner for task in self.done})) < len(self.done):
                dampers = f"{self.n_tasks} tests of {counted(n, 'damper')}"
            lines.append(f"{dampers}: {states}; {n_logs} logs, {settings}")
        if (check := self.check) is not None:
            lines.append(f"tolerance {check.source}: {check.sentence}")
            for point in check.worst[:_MANY]:
                setting = f", setting {point.setting}" if str(point.setting) else ""
                speed = (
                    f", {point.speed:g} m/s {STROKE_WORDS[point.stroke]}" if point.stroke else ""
                )
                lines.append(f"{point.run or 'unknown'}{setting}{speed}: {point.words}")
            if (n_more := len(check.worst) - _MANY) > 0:
                lines.append(f"and {counted(n_more, 'more damper')}; --report lists them")
        return "\n".join(lines)

    @property
    def remarks(self) -> tuple[Problem, ...]:  # type: ignore[override]
        """Failures, also of earlier runs, missed gates, and what an interrupt has left."""
        owners = [(task.owner or "logs", task) for task in self.done]
        failures = [problem.of(owner) for owner, task in owners for problem in task.failures]
        gates = [problem.of(owner) for owner, task in owners for problem in task.gates]
        if (n_more := len(failures) - _MANY) > 0:
            text = f"and {n_more} more failures; the parts in {self.folder} hold them all"
            failures[_MANY:] = [note("more", text)]
        if self.is_stopped:
            dampers = f"{self.n_tasks - len(self.done)} of {self.n_tasks} dampers left"
            text = f"interrupted; {dampers}, the same command goes on with them"
            gates.append(note("interrupted", text))
        return (*failures, *gates)

    @property
    def written(self) -> tuple[str, ...]:
        """Where parts and tables are."""
        lines = []
        if self.n_tasks and not self.is_stopped:
            lines.append(f"parts in {self.folder}")
        if self.n_rows is not None:
            table = f"{self.folder}/{SUMMARY}/fleet.parquet and .csv"
            lines.append(f"{self.n_rows} rows of the fleet in {table}")
        if self.page is not None:
            lines.append(f"{self.page} written, with tables of dampers and outliers")
        return tuple(lines)

    def __repr__(self) -> str:
        return "\n".join(filter(None, (super().__repr__(), *self.written)))
