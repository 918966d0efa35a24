"""A damper stroke measured on a car: how fast it moves, and what each setting does there."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning.filters import differentiate
from damperfit.errors import ConfigurationError
from damperfit.io.files import read_text
from damperfit.reporting.sheet import Sheet
from damperfit.simulation import Motion
from damperfit.tables.files import json_values
from damperfit.units.quantities import QuantityError, parse_quantity

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from damperfit.results import Run, SettingResult

    FloatArray = NDArray[np.float64]

__all__ = ["Band", "DrivenStroke", "drive_along", "read_stroke"]

_EDGES = (0.0, 0.025, 0.05, 0.1, 0.2, 0.5, np.inf)  # m/s
_GAP = 10.0  # times the usual step in time
_NAMES = {
    "time": (r"time|t", "time"),
    "displacement": (
        r"displacement|position|stroke|travel|damper[ _](?:position|pos|travel|displacement)|x",
        "length",
    ),
}


@dataclass(frozen=True, slots=True)
class Band:
    """One band of speed: share of the time in it, and the mean power of each setting there, W."""

    low: float
    high: float
    share: float
    powers: dict[str, float]


@dataclass(frozen=True, slots=True)
class DrivenStroke:
    """What settings do along a measured stroke."""

    seconds: float
    bands: tuple[Band, ...]
    outside: dict[str, float]  # s beyond the tested speed, by setting

    @property
    def sentence(self) -> str:
        """Where most of the energy goes, and where the clicks act."""
        settings = list(self.outside)
        total = {band: sum(band_.powers.values()) for band, band_ in enumerate(self.bands)}
        most = self.bands[max(total, key=lambda band: total[band])]
        text = (
            f"{self.seconds:.3g} s; most energy is dissipated at {most.low:g} to "
            f"{most.high:g} m/s, in {100.0 * most.share:.2g} % of the time"
        )
        if len(settings) > 1:
            spread = [abs(b.powers[settings[-1]] - b.powers[settings[0]]) for b in self.bands]
            acting = self.bands[int(np.argmax(spread))]
            text += (
                f"; from setting {settings[0]} to {settings[-1]} the clicks act most at "
                f"{acting.low:g} to {acting.high:g} m/s"
            )
        return text

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        values = {
            "seconds": self.seconds,
            "sentence": self.sentence,
            "bands": [asdict(band) for band in self.bands],
            "outside_s": self.outside,
        }
        return {name: json_values(value) for name, value in values.items()}

    def sheet(self) -> Sheet:
        """Return one row a setting, one column a band of speed."""
        known = [band for band in self.bands if band.share > 0.0]
        rows = (
            ("time", *(f"{100.0 * band.share:.3g} %" for band in known), ""),
            *(
                (label, *(f"{band.powers[label]:.3g}" for band in known), f"{outside:.2g}")
                for label, outside in self.outside.items()
            ),
        )
        return Sheet(
            ("set", *(f"{band.low:g} to {band.high:g}" for band in known), "untested"),
            ("", *("W at m/s" for _ in known), "s"),
            rows,
            (False, *(True for _ in known), True),
        )


def read_stroke(path: Path) -> Motion:
    """Read time and displacement of a text log, as in ``time_s,displacement_mm``.

    Raises
    ------
    ConfigurationError
        It has no such columns, or times that do not rise.
    """
    import io

    import pandas as pd

    if not path.is_file():
        raise ConfigurationError("no such file", subject=path, code="stroke")
    try:
        text = read_text(path)
    except UnicodeDecodeError:
        raise ConfigurationError("no text in UTF-8", subject=path, code="stroke") from None
    head = next((line for line in text.splitlines() if line and not line.startswith("#")), "")
    separator = max(";\t,", key=head.count)
    decimal = "," if separator != "," and "," in text else "."
    try:
        frame = pd.read_csv(io.StringIO(text), comment="#", sep=separator, decimal=decimal)
    except ValueError as error:
        sentence = f"no table with a row of names: {error}"
        raise ConfigurationError(sentence, subject=path, code="stroke") from None
    channels = {name: _channel(path, frame, name) for name in _NAMES}
    time, displacement = channels["time"], channels["displacement"]
    if len(time) < 10:
        sentence = f"found {len(time)} rows; expected ten or more"
        raise ConfigurationError(sentence, subject=path, code="stroke")
    steps = np.diff(time)
    if not (steps > 0.0).all():
        row = int(np.argmin(steps > 0.0)) + 2
        raise ConfigurationError(f"time does not rise at row {row}", subject=path, code="stroke")
    interval = float(np.median(steps))
    if steps.max() > _GAP * interval:
        row = int(np.argmax(steps)) + 2
        sentence = f"a gap of {steps.max():.3g} s before row {row}; cut the log there"
        raise ConfigurationError(sentence, subject=path, code="stroke")
    uniform = np.arange(time[0], time[-1], interval)
    x = np.interp(uniform, time, displacement)
    x -= 0.5 * (x.max() + x.min())
    return Motion(interval, x, differentiate(x, interval))


def _channel(path: Path, frame: Any, name: str) -> FloatArray:
    import pandas as pd

    words, dimension = _NAMES[name]
    example = "s" if name == "time" else "mm"
    for column in frame.columns:
        found = re.fullmatch(
            rf"\s*(?:{words})[ _(\[]*([^)\]\s]*)[)\]]?\s*", str(column), re.IGNORECASE
        )
        if found is None:
            continue
        if not found[1]:
            sentence = f"column {column!r} has no unit; name it as in {name}_{example}"
            raise ConfigurationError(sentence, subject=path, code="stroke")
        try:
            factor = parse_quantity(f"1{found[1]}", dimension)
        except QuantityError as error:
            sentence = f"column {column!r}: {error}"
            raise ConfigurationError(sentence, subject=path, code="stroke") from None
        values = pd.to_numeric(frame[column], errors="coerce").to_numpy(np.float64)
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values))) + 1
            sentence = f"column {column!r}, row {row}: no number"
            raise ConfigurationError(sentence, subject=path, code="stroke")
        return np.asarray(values * factor, dtype=np.float64)
    columns = ", ".join(map(str, frame.columns))
    raise ConfigurationError(
        f"no column of {name}; found {columns}; expected one as in {name}_{example}",
        subject=path,
        code="stroke",
    )


def drive_along(run: Run, motion: Motion, settings: Sequence[SettingResult]) -> DrivenStroke:
    """Return what settings of a run dissipate along a stroke, by band of speed."""
    speed = np.abs(motion.velocity)
    n = len(speed)
    places = np.digitize(speed, _EDGES) - 1
    powers: dict[str, list[float]] = {}
    outside: dict[str, float] = {}
    for setting in settings:
        seen = run.damper.simulate(setting.parameters, motion, sensitivities=(), options=run.solver)
        rest = run.damper.rest_force(motion.displacement)
        damping = seen.force - (0.0 if rest is None else rest)
        work = damping * motion.velocity
        powers[setting.label] = [
            float(work[places == band].sum() / n) for band in range(len(_EDGES) - 1)
        ]
        outside[setting.label] = float(np.sum(speed > setting.top_speed) * motion.interval)
    bands = tuple(
        Band(
            _EDGES[band],
            _EDGES[band + 1],
            float(np.mean(places == band)),
            {label: values[band] for label, values in powers.items()},
        )
        for band in range(len(_EDGES) - 1)
    )
    return DrivenStroke(n * motion.interval, bands, outside)
