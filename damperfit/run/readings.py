"""What is read off the logs beside the fit: the tables "characteristics" and "valves"."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from damperfit.errors import sparing
from damperfit.parallel import apart, told_here
from damperfit.tables import characteristic_rows, lay_out, valve_rows

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
    jobs : int
        Workers.
    rows : list of dict
        What was noted.
    """

    configuration: Configuration
    campaign: Campaign
    mishaps: Mishaps
    jobs: int = 1
    rows: list[dict[str, Any]] = field(default_factory=list)

    def noted(self, seen: Iterable[SimulatedLog | None]) -> Iterator[SimulatedLog | None]:
        """Pass simulated logs on as they come: they are large, and wanted once.

        Of many logs the rows are read off in other processes while who asks for these writes them.
        """
        damper, solver = self.configuration.damper, self.configuration.identification.solver
        take = told_here(self.mishaps.at_log("reading the characteristics of"))

        def rows(pair: tuple[Fit, LogFit]) -> list[dict[str, Any]]:
            fit, log = pair
            try:
                one = log.compared(fit.parameters, damper, solver)
            except Exception:  # noqa: BLE001 - whoever writes its signals says so
                return []
            try:
                return list(characteristic_rows(fit.setting, log.trace, one, damper))
            except Exception as error:  # noqa: BLE001 - the other logs have theirs
                take(log.trace, error)
                return []

        logs = [(fit, log) for fit in self.campaign.fits for log in fit.logs]
        for one, found in zip(seen, apart(rows, logs, jobs=self.jobs), strict=True):
            self.rows += found
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
