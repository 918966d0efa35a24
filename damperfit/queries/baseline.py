"""A run kept as one JSON file, to be the reference of later comparisons."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit import __version__, results
from damperfit.comparison import MeasuredTest
from damperfit.errors import ConfigurationError
from damperfit.io.files import open_regular, read_text
from damperfit.tables import column_names, quantities_in
from damperfit.tables.columns import adjusters_in, read_setting, setting_cells
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from damperfit.comparison import ComparedRun

__all__ = ["Baseline", "baseline_text", "compared_record", "is_baseline", "read_baseline"]

_KEY, _VERSION = "damperfit_baseline", 1
# Of run.json: what is compared, or says what is compared.
_KEPT = (
    *("version", "schema_version", "test", "configuration", "procedure", "uncertainty"),
    *("speed_forces", "quantities", "adjusters"),
)
_OF_INPUTS = (
    *("log", "sha256", "setting", "reversed"),
    *("amplitude_m", "frequency_Hz", "temperature_degC"),
)
_ARRAYS = ("displacement", "velocity", "force", "simulated", "speeds")
_DIGITS = 7  # as many as 32-bit floats have


@dataclass(frozen=True, slots=True, eq=False)
class Baseline:
    """What a baseline holds.

    Attributes
    ----------
    results : ComparedRun
        Parameters and run.json, as far as they are compared.
    tests : tuple of MeasuredTest
        Mean cycles.
    """

    results: results.Run
    tests: tuple[MeasuredTest, ...]


def baseline_text(run: ComparedRun) -> str:
    """Return a run as the text of a baseline; of measured curves alone without parameters."""
    known = () if run.fitted is None else run.fitted.rows("parameters")
    rows = {Setting.of(row["setting"]): row for row in known}
    record = compared_record(run.record)
    settings = list(rows)
    is_whole = all(isinstance(one.cell, int) for one in settings)
    document = {
        _KEY: _VERSION,
        "version": __version__,
        "source": run.name,
        "record": record,
        "parameters": [
            # The columns of adjusters are those that follow the setting.
            {
                **setting_cells(setting, is_whole=is_whole),
                **{name: cell for name, cell in row.items() if name != "setting"},
            }
            for setting, row in rows.items()
        ],
        "tests": [_test_record(test) for test in run.tests],
    }
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def compared_record(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of run.json is compared, or says what is compared."""
    inputs = record.get("inputs")
    return {key: record[key] for key in _KEPT if key in record} | {
        "inputs": [
            {key: one[key] for key in (*_OF_INPUTS, "stretches") if key in one}
            for one in (inputs if isinstance(inputs, list) else ())
            if isinstance(one, dict)
        ]
    }


def _test_record(test: MeasuredTest) -> dict[str, Any]:
    assert test.setting is not None
    return {
        "setting": setting_cells(test.setting, is_whole=isinstance(test.setting.cell, int)),
        "log": test.log,
        "n_cycles": test.n_cycles,
        **{
            name: _finite(getattr(test, name)) for name in ("amplitude", "frequency", "temperature")
        },
        **{name: _rounded(getattr(test, name)) for name in _ARRAYS},
        "strokes": {name: [_rounded(row) for row in rows] for name, rows in test.strokes.items()},
        "figures": {name: [_finite(x) for x in pair] for name, pair in test.figures.items()},
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _rounded(values: Any) -> list[float | None]:
    return [float(f"{x:.{_DIGITS}g}") if math.isfinite(x) else None for x in values.tolist()]


def is_baseline(path: Path) -> bool:
    """Whether a file says that it is a baseline."""
    if path.suffix.lower() != ".json":
        return False
    try:
        with open_regular(path) as file:
            return f'"{_KEY}"'.encode() in file.read(200)
    except OSError:
        return False


def read_baseline(path: Path, *, config: Path | None = None) -> Baseline:
    """Return what a baseline holds.

    Raises
    ------
    ConfigurationError
        It is damaged, or of a later damperfit.
    """
    try:
        document = json.loads(read_text(path))
        if document[_KEY] != _VERSION:
            raise ConfigurationError(
                f"a baseline of form {document[_KEY]} (damperfit "
                f"{document.get('version')}), and this damperfit knows {_VERSION}; save it again",
                subject=path,
            )
        record, rows = document["record"], document["parameters"]
        quantities = quantities_in(record, list(rows[0]) if rows else ())
        names = adjusters_in(list(rows[0]), quantities) if rows else ()
        parameters = tuple({**row, "setting": read_setting(row, names)} for row in rows)
        tests = tuple(_test(one) for one in document["tests"])
    except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        raise ConfigurationError(
            f"a damaged baseline ({type(error).__name__}: {error}); save it again with "
            "damperfit compare RESULTS --save FILE",
            subject=path,
        ) from error
    run = results.Run(
        record, {"parameters": parameters}, quantities=quantities, place=path, config=config
    )
    return Baseline(run, tests)


def _test(record: dict[str, Any]) -> MeasuredTest:
    cells = record["setting"]
    names = [name for name in cells if name != "setting" and name not in column_names()]
    return MeasuredTest(
        setting=read_setting(cells, names) or Setting.of(0),
        log=str(record["log"]),
        n_cycles=int(record["n_cycles"]),
        amplitude=_number(record["amplitude"]),
        frequency=_number(record["frequency"]),
        temperature=_number(record["temperature"]),
        displacement=_array(record["displacement"]),
        velocity=_array(record["velocity"]),
        force=_array(record["force"]),
        simulated=_array(record["simulated"]),
        speeds=_array(record["speeds"]),
        strokes={
            name: np.stack([_array(row) for row in rows])
            for name, rows in record["strokes"].items()
        },
        figures={
            name: (_number(value), _number(error))
            for name, (value, error) in record["figures"].items()
        },
    )


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _array(values: list[float | None]) -> Any:
    return np.array([_number(value) for value in values])
