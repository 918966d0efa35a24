"""What a run found: the fits, judged, and the tables and the record made of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from damperfit.results import Run
from damperfit.run.run_json import ending_of, record, report_facts
from damperfit.run.work import profile_points
from damperfit.tables.columns import PAPER_QUANTITIES
from damperfit.tables.rows import make_tables

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa

    from damperfit.configuration.options import Configuration
    from damperfit.identification import Campaign
    from damperfit.report.facts import Failure, ReportFacts
    from damperfit.run.ending import Ending
    from damperfit.run.logs import LogBatch
    from damperfit.run.run_json import Judgement

__all__ = ["Found", "RunResult"]


class RunResult(Run):
    """A run as `identify` has it: its tables in memory, the fits behind them, how it ended.

    Attributes
    ----------
    ending : Ending
        How it ended.
    campaign : Campaign
        The fits.
    facts : ReportFacts
        Failures, warnings, procedure.
    keeps_earlier : bool
        Nothing was fitted, and nothing written: the folder keeps the results that it had.
    """

    def __init__(
        self,
        tables: Mapping[str, pa.Table | None],
        campaign: Campaign,
        facts: ReportFacts,
        record: dict[str, Any],
        *,
        ending: Ending,
    ) -> None:
        made = {name: table for name, table in tables.items() if table is not None}
        super().__init__(record, quantities=campaign.quantities or PAPER_QUANTITIES, tables=made)
        self.campaign = campaign
        self.facts = facts
        self.ending = ending
        self.keeps_earlier = False

    def document(self) -> dict[str, Any]:
        """Return run.json and the rows of both tables as one JSON document."""
        return self.record | {
            name: self._tables[name].to_pylist() for name in ("parameters", "mse")
        }


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """All that a run has found, from which its account is made."""

    configuration: Configuration
    batch: LogBatch
    campaign: Campaign
    judgement: Judgement
    origin: Mapping[str, Any]
    is_interrupted: bool

    @property
    def without_responses(self) -> Found:
        """The same without what was kept of the last simulations."""
        return replace(self, campaign=self.campaign.without_responses)

    def result(
        self,
        mishaps: tuple[Failure, ...],
        characteristics: pa.Table | None = None,
        valves: pa.Table | None = None,
    ) -> RunResult:
        """Return the account of it; `mishaps` are settings and logs that could not be judged."""
        judgement = replace(self.judgement, failures=mishaps)
        facts = report_facts(
            self.configuration,
            self.batch,
            self.campaign,
            judgement,
            is_interrupted=self.is_interrupted,
        )
        ending = ending_of(self.campaign, facts)
        made: dict[str, pa.Table | None] = {
            **make_tables(
                self.campaign,
                assessment=judgement.assessment,
                predictions=judgement.predictions,
                adjustment=judgement.adjustment,
                expected=self.configuration.rig.settings,
                facts=self.origin,
            ),
            "characteristics": characteristics,
            "valves": valves,
            "profiles": profile_points(self.configuration, judgement, self.origin),
        }
        return RunResult(
            made,
            self.campaign,
            facts,
            record(self.configuration, self.batch, facts, self.campaign, judgement, ending=ending),
            ending=ending,
        )
