"""What is read off the logs beside the fit: the tables "characteristics" and "valves"."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from damperfit.errors import sparing
from damperfit.tables.files import lay_out
from damperfit.tables.rows import characteristic_rows, valve_rows
from damperfit.workers import told_here

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    import pyarrow as pa

    from damperfit.configuration.options import Configuration
    from damperfit.identification import Campaign, Fit, LogFit, SimulatedLog
    from damperfit.run.mishaps import Mishaps

__all__ = ["Readings"]


@dataclass(slots=True)
class Readings:
    """The characteristics of the logs of a campaign, noted as they pass.

    Attributes
    ----------
    configuration : Configuration
        Whose damper's gas force is taken off.
    campaign : Campaign
        The fits.
    mishaps : Mishaps
        Takes what goes wrong with one log.
    rows : list of dict
        What was noted.
    """

    configuration: Configuration
    campaign: Campaign
    mishaps: Mishaps
    rows: list[dict[str, Any]] = field(default_factory=list)

    @property
    def logs(self) -> list[tuple[Fit, LogFit]]:
        """Each log with the fit of its setting."""
        return [(fit, log) for fit in self.campaign.fits for log in fit.logs]

    def of_log(
        self, fit: Fit, log: LogFit, seen: SimulatedLog | None = None
    ) -> list[dict[str, Any]]:
        """Return the rows of one log; without its simulation, which is large, it is asked for."""
        damper, solver = self.configuration.damper, self.configuration.identification.solver
        try:
            one = log.compared(fit.parameters, damper, solver) if seen is None else seen
        except Exception:  # noqa: BLE001 - whoever writes its signals says so
            return []
        try:
            return list(characteristic_rows(fit.setting, log.trace, one, damper))
        except Exception as error:  # noqa: BLE001 - the other logs have theirs
            take = told_here(self.mishaps.at_log("reading the characteristics of"))
            take(log.trace, error)
            return []

    def noted(self, seen: Iterable[SimulatedLog | None]) -> Iterator[SimulatedLog | None]:
        """Pass simulated logs on as they come: they are large, and wanted once."""
        for (fit, log), one in zip(self.logs, seen, strict=True):
            if one is not None:
                self.rows += self.of_log(fit, log, one)
            yield one

    def table(self, origin: Mapping[str, Any]) -> pa.Table:
        """Return the table of what was noted."""
        return lay_out(
            "characteristics",
            self.rows,
            facts=origin,
            settings=[fit.setting for fit in self.campaign.fits],
            quantities=self.campaign.quantities,
        )

    def valves(self, origin: Mapping[str, Any]) -> pa.Table | None:
        """Return the table of the valves of each setting; None where the model has none."""
        damper = self.configuration.damper
        rows: list[dict[str, Any]] = []
        take = self.mishaps.at_setting("reading the valves of")
        for fit in self.campaign.fits:
            with sparing(fit.setting, take):
                traces = [log.trace for log in fit.logs]
                found = damper.valve_characteristics(fit.parameters, traces)
                rows += valve_rows(fit.setting, found)
        if not rows:
            return None
        return lay_out(
            "valves",
            rows,
            facts=origin,
            settings=[fit.setting for fit in self.campaign.fits],
            quantities=self.campaign.quantities,
        )
