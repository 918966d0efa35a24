"""Whose model misses the measured force, by how much, and what a comparison says there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.comparison.circumstances import have_common_logs
from damperfit.comparison.words import place_of
from damperfit.identification.sharing import of_settings
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.comparison.reading import Difference, Reading, Topic
    from damperfit.comparison.run import ComparedRun
    from damperfit.units.shown_units import ShownUnits

__all__ = ["missed_notes"]


def missed_notes(
    runs: Sequence[ComparedRun],
    tables: Sequence[Mapping[Topic, Reading]],
    lines: Sequence[Difference],
    units: ShownUnits = SI,
) -> Iterator[str]:
    """Yield why forces of fitted runs are compared as measured; nothing where none is.

    Parameters
    ----------
    runs : sequence of ComparedRun
        All that were compared.
    tables : sequence of mapping
        The forces of each.
    lines : sequence of Difference
        What came of it.
    units : ShownUnits
        In which it is told.
    """
    measured = [line.subject for line in lines if line.subject.kind == "force" and line.is_measured]
    if not measured:
        return
    for run, table in zip(runs, tables, strict=True):
        missed = {topic: one for topic, one in table.items() if one.disagrees}
        if not missed or run.fitted is None:
            continue
        topic, worst = max(missed.items(), key=lambda item: abs(item[1].misses))
        share = f" ({abs(worst.misses / worst.scale):.1%} of the damping)" if worst.scale else ""
        yield (
            f"{run.name}: its model ({run.fitted.damper.name}) misses the measured force at "
            f"{_where(missed)}, most {place_of(topic, units)}: "
            f"by {units.write(abs(worst.misses), 'N', '.3g')}{share}"
        )
    said = "they show how the tests differ and say nothing about the models"
    if have_common_logs(runs[0], runs[-1]):
        said = "both are based on the same logs, so this says nothing about the models"
    yield f"at {_where(measured)} the measured forces of both are compared: {said}"


def _where(topics: Sequence[Topic] | Mapping[Topic, Reading]) -> str:
    return of_settings(dict.fromkeys(one.setting for one in topics if one.setting))
