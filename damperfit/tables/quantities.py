"""The quantities of a model in the metadata of tables, and back."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from damperfit.damper.model import values_type
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.quantity import Quantity

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.model import Values

__all__ = ["PAPER_QUANTITIES", "quantities_in", "quantity_records", "values_from"]

# Older results do not tell theirs: they are the paper's.
PAPER_QUANTITIES = PURDY_DAMPER.quantities
# Nor does what was written before quantities had a role and an ideal value.
_LATER = {one.label: {"role": one.role, "ideal": one.ideal} for one in PAPER_QUANTITIES}


def quantity_records(quantities: Sequence[Quantity]) -> list[dict[str, Any]]:
    """Return quantities as JSON values; what has no limit has none."""
    return [
        {one.name: _as_json(getattr(quantity, one.name)) for one in fields(Quantity)}
        for quantity in quantities
    ]


def _as_json(value: Any) -> Any:
    if isinstance(value, tuple):
        return [end if math.isfinite(end) else None for end in value]
    return value


def quantities_in(facts: Mapping[str, Any], columns: Sequence[str] = ()) -> tuple[Quantity, ...]:
    """Return the quantities that the facts of a table or run.json tell, in their order.

    Parameters
    ----------
    facts : mapping
        With the key "quantities", but for older results, which are the paper's.
    columns : sequence of str
        Of the table, where known: where the facts tell nothing and a column has a status that the
        paper's model does not know, the columns say what there is.
    """
    records = facts.get("quantities")
    try:
        found = tuple(_quantity(one) for one in records) if isinstance(records, list) else ()
    except (KeyError, TypeError, ValueError):
        found = ()
    if found:
        return PAPER_QUANTITIES if found == PAPER_QUANTITIES else found
    seen = [name.removesuffix("_status") for name in columns if name.endswith("_status")]
    if set(seen) <= {one.name for one in PAPER_QUANTITIES}:
        return PAPER_QUANTITIES
    return tuple(Quantity(name, name, name, name, "", (-math.inf, math.inf)) for name in seen)


def _quantity(record: Mapping[str, Any]) -> Quantity:
    known = {one.name: record[one.name] for one in fields(Quantity) if one.name in record}
    ranges = {key: _range(ends) for key, ends in known.items() if isinstance(ends, list)}
    return Quantity(**_LATER.get(known["label"], {}) | known | ranges)


def _range(ends: Sequence[float | None]) -> tuple[float, float]:
    low, high = ends
    return -math.inf if low is None else float(low), math.inf if high is None else float(high)


def values_from(quantities: tuple[Quantity, ...], numbers: Sequence[float]) -> Values:
    """Return values read from a table."""
    is_paper = quantities == PAPER_QUANTITIES
    kind = PURDY_DAMPER.values_type if is_paper else values_type(quantities)
    return kind(*numbers)
