"""What a run found: the fits, judged, and the tables and the record made of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from damperfit.run.run_json import ending_of, record, report_facts
from damperfit.run.work import profile_points
from damperfit.tables import make_tables

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa

    from damperfit.configuration.options import Configuration
    from damperfit.identification import Campaign
    from damperfit.report.facts import Failure, ReportFacts
    from damperfit.run.ending import Ending
    from damperfit.run.logs import LogBatch
    from damperfit.run.run_json import Judgement
    from damperfit.tables import Tables

__all__ = ["Found", "RunResult"]


@dataclass(frozen=True, slots=True, eq=False)
class RunResult:
    """What a run found.

    Attributes
    ----------
    ending : Ending
        How it ended.
    campaign : Campaign
        The fits.
    tables : Tables
        Parameters and MSE.
    facts : ReportFacts
        Failures, warnings, procedure.
    record : dict
        What stands in run.json.
    profiles : pyarrow.Table or None
        Points of the profiles that were asked for.
    characteristics : pyarrow.Table or None
        What is read off each stretch; None where nothing was written.
    valves : pyarrow.Table or None
        Flow against pressure of each valve; None where the model has none.
    keeps_earlier : bool
        Nothing was fitted, and nothing written: the folder keeps the results that it had.
    """

    ending: Ending
    campaign: Campaign
    tables: Tables
    facts: ReportFacts
    record: dict[str, Any]
    profiles: pa.Table | None = None
    characteristics: pa.Table | None = None
    valves: pa.Table | None = None
    keeps_earlier: bool = False

    @property
    def written(self) -> dict[str, pa.Table]:
        """Tables by the name of their files."""
        always = {
            "parameters": self.tables.parameters,
            "mse": self.tables.mse,
            "adjustment": self.tables.adjustment,
        }
        more = {
            "characteristics": self.characteristics,
            "valves": self.valves,
            "profiles": self.profiles,
        }
        return always | {name: table for name, table in more.items() if table is not None}

    def document(self) -> dict[str, Any]:
        """Return run.json and the rows of both tables as one JSON document."""
        return self.record | {
            "parameters": self.tables.parameters.to_pylist(),
            "mse": self.tables.mse.to_pylist(),
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
        return RunResult(
            ending=ending,
            campaign=self.campaign,
            tables=make_tables(
                self.campaign,
                assessment=judgement.assessment,
                predictions=judgement.predictions,
                adjustment=judgement.adjustment,
                expected=self.configuration.rig.settings,
                provenance=self.origin,
            ),
            facts=facts,
            record=record(
                self.configuration, self.batch, facts, self.campaign, judgement, ending=ending
            ),
            profiles=profile_points(self.configuration, judgement, self.origin),
            characteristics=characteristics,
            valves=valves,
        )
