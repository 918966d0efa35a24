"""The tables of a results folder as plain columns with headings and units, for spreadsheets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.errors import ConfigurationError
from damperfit.handover.force_table import force_tables

if TYPE_CHECKING:
    from collections.abc import Iterator

    from damperfit.handover.handed_over import HandedOver
    from damperfit.handover.targets import ExportOptions
    from damperfit.units.shown_units import ShownUnits

__all__ = ["TABLE_NAMES", "PlainTable", "forces_by_setting", "stored_tables"]

TABLE_NAMES = ("parameters", "mse", "adjustment", "characteristics")


@dataclass(frozen=True, slots=True)
class PlainTable:
    """A table as columns.

    Attributes
    ----------
    name : str
        Of the table.
    headings, units : tuple of str
        One per column.
    columns : tuple of tuple
        Numbers, text, or None where nothing is known.
    """

    name: str
    headings: tuple[str, ...]
    units: tuple[str, ...]
    columns: tuple[tuple[Any, ...], ...]


def forces_by_setting(handed: HandedOver, options: ExportOptions) -> PlainTable:
    """Return force by speed, a column for each setting; the gas force is not in it."""
    tables = force_tables(handed, extend=options.extend)
    shown = options.units
    columns = [shown.show(tables[0].speeds, "m/s"), *(shown.show(t.forces, "N") for t in tables)]
    return PlainTable(
        "forces",
        (shown.column("speed_m_per_s", "m/s"), *(f"setting {t.setting}" for t in tables)),
        (shown.of("m/s"), *(shown.of("N") for _ in tables)),
        tuple(tuple(column.tolist()) for column in columns),
    )


def stored_tables(handed: HandedOver, units: ShownUnits) -> Iterator[PlainTable]:
    """Yield the tables that `identify` wrote, as far as they are there.

    Raises
    ------
    ConfigurationError
        One cannot be read.
    """
    if handed.folder is None:
        return
    for name in TABLE_NAMES:
        path = handed.folder / f"{name}.parquet"
        if not path.is_file():
            continue
        try:
            with pq.ParquetFile(path, page_checksum_verification=True) as file:
                table = file.read()
        except (OSError, ValueError, pa.ArrowException) as error:
            raise ConfigurationError(
                f"{path}: cannot be read: {error}; run damperfit identify LOGS again"
            ) from error
        yield _plain(name, table, units)


def _plain(name: str, table: pa.Table, units: ShownUnits) -> PlainTable:
    headings, shown, columns = [], [], []
    for field, column in zip(table.schema, table.columns, strict=True):
        unit = (field.metadata or {}).get(b"unit", b"").decode()
        unit = "" if unit == "1" else unit
        headings.append(units.column(field.name, unit))
        shown.append(units.of(unit))
        cells = column.to_pylist()
        if units.of(unit) != unit:
            cells = [None if cell is None else units.show(float(cell), unit) for cell in cells]
        columns.append(tuple(cells))
    return PlainTable(name, tuple(headings), tuple(shown), tuple(columns))
