"""A simulated test as a notebook holds it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.queries.chosen_parameters import choose_parameters
from damperfit.queries.one_simulation import damper_of, simulate_test

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from damperfit.configuration.options import Configuration
    from damperfit.queries.one_simulation import SimulatedTest
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["Simulation", "simulated"]


class Simulation:
    """A simulated test: signals in SI, positive in rebound, and the figures of its last cycle.

    Attributes
    ----------
    test : SimulatedTest
        As `damperfit simulate` has it.
    """

    def __init__(self, test: SimulatedTest) -> None:
        self.test = test

    @property
    def time(self) -> FloatArray:
        """Time stamps (n,), s."""
        return self.test.response.time

    @property
    def displacement(self) -> FloatArray:
        """Displacement (n,), m."""
        return self.test.response.displacement

    @property
    def velocity(self) -> FloatArray:
        """Velocity (n,), m/s."""
        return self.test.response.velocity

    @property
    def force(self) -> FloatArray:
        """Force (n,), N."""
        return self.test.response.force

    @property
    def pressures(self) -> FloatArray:
        """Absolute pressures of the chambers (3, n), Pa."""
        return self.test.response.pressures

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before believing the figures, a sentence each."""
        return self.test.warnings

    def to_frame(self) -> pd.DataFrame:
        """Return the signals as a data frame, with units in the names of its columns."""
        from damperfit.tables import time_series_table

        frame: pd.DataFrame = time_series_table(self.test.response).to_pandas()
        return frame

    def plot(self) -> Any:
        """Draw force against velocity and against displacement; return both matplotlib axes."""
        from damperfit.report.drawing import matplotlib_of_files

        matplotlib_of_files()
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9.0, 3.8), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, sharey=True)
        left.plot(self.velocity, self.force)
        right.plot(1e3 * self.displacement, self.force)
        left.set(xlabel="velocity, m/s", ylabel="force, N")
        right.set(xlabel="displacement, mm")
        return [left, right]

    def __repr__(self) -> str:
        force, setting = self.force, self.test.choice.setting
        return (
            f"<Simulation: {self.test.motion}; force {force.min():.0f} to {force.max():.0f} N"
            f"{'' if setting is None else f'; setting {setting}'}>"
        )


def simulated(
    setting: Setting | int | str | None,
    configuration: Configuration,
    *,
    table: Path | None,
    replaced: Mapping[str, str],
    config: Path | None = None,
    log: Path | None = None,
) -> Simulation:
    """Return one setting simulated, of a table or of the reference set."""
    choice = choose_parameters(setting, table=table, replaced=replaced, damper=configuration.damper)
    meant, _ = damper_of(choice, configuration, config=config)
    return Simulation(simulate_test(choice, meant, log=log))
