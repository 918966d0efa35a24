"""What `inspect` and `compare` return: they print themselves, and give data frames."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

from damperfit.report.sheet import html_table, text_table

if TYPE_CHECKING:
    import pandas as pd

    from damperfit.queries.comparisons import Compared
    from damperfit.report.sheet import Sheet
    from damperfit.run.logs import LogBatch

__all__ = ["Comparison", "Inspection"]


class Inspection:
    """What is in logs.

    Attributes
    ----------
    batch : LogBatch
        What was found of each.
    """

    def __init__(self, batch: LogBatch) -> None:
        self.batch = batch

    @property
    def failures(self) -> tuple[str, ...]:
        """Logs that cannot be used, a sentence each."""
        return tuple(failure.message for failure in self.batch.failures)

    @property
    def findings(self) -> tuple[str, ...]:
        """What their data show, a sentence each."""
        from damperfit.report.inspection import finding_lines

        return tuple(finding_lines([log.facts for log in self.batch.logs], has_notes=True))

    def to_frame(self) -> pd.DataFrame:
        """Return one row a log: setting, rate, cycles, frequency, amplitude, verdict ..."""
        import pandas as pd

        rows = []
        for log in self.batch.logs:
            flat: dict[str, Any] = {
                k: v for k, v in log.facts.items() if isinstance(v, str | int | float | bool)
            }
            setting = log.facts.get("setting")
            flat["setting"] = None if setting is None else str(setting)
            rows.append({"log": log.log, **flat})
        return pd.DataFrame(rows)

    def _sheet(self) -> Sheet:
        from damperfit.report.inspection import inspection_sheet

        return inspection_sheet([log.facts for log in self.batch.logs])

    def __repr__(self) -> str:
        n, n_bad = len(self.batch.logs), len(self.batch.failures)
        return f"<Inspection: {n} log{'' if n == 1 else 's'}, {n_bad} cannot be used>"

    def __str__(self) -> str:
        return "\n".join([text_table(self._sheet()), *self.findings])

    def _repr_html_(self) -> str:
        return html_table(self._sheet(), caption=repr(self)[1:-1])


class Comparison:
    """What differs between results.

    Attributes
    ----------
    compared : Compared
        Every pair.
    """

    def __init__(self, compared: Compared) -> None:
        self.compared = compared

    @property
    def sentences(self) -> tuple[str, ...]:
        """Verdicts in words."""
        return tuple(line for one in self.compared.comparisons for line in one.sentences)

    @property
    def is_met(self) -> bool:
        """Whether every force is within its band, where a tolerance was given."""
        return all(point.is_met for point in self.compared.points)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a difference: values of both, interval of the difference, verdict."""
        from damperfit.report.compared import comparison_rows, comparison_table

        rows = [row for one in self.compared.comparisons for row in comparison_rows(one)]
        frame: pd.DataFrame = comparison_table(rows).to_pandas()
        return frame

    def _sheets(self) -> list[Sheet]:
        from damperfit.report.compared import comparison_force_sheet

        return [comparison_force_sheet(one) for one in self.compared.comparisons]

    def __repr__(self) -> str:
        n = len(self.compared.comparisons)
        first = f": {self.sentences[0]}" if self.sentences else ""
        return f"<Comparison of {n} pair{'' if n == 1 else 's'}{first}>"

    def __str__(self) -> str:
        return "\n".join([*self.sentences, *map(text_table, self._sheets())])

    def _repr_html_(self) -> str:
        said = "".join(f"<p>{escape(line)}</p>" for line in self.sentences)
        return said + "".join(map(html_table, self._sheets()))
