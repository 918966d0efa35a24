"""What damperfit has written itself, so that nobody fits its results as if they were measured."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from damperfit.quantities import units_of

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["is_own_table"]

# How the tables in CSV begin, as far as their settings are of one adjuster.
_HEADINGS = (
    b"setting,r_m1,",
    b"setting,log,mse_percent,",
    *(  # in whichever units they were asked for
        f"setting,speed_{unit.replace('/', '_per_')},stroke,".encode()
        for unit in units_of("velocity")
    ),
    b"setting,log,stretch,kind,",
    b"serial,damper,date,setting,",
)
_LONGEST = max(map(len, _HEADINGS))
_FACTS = b"damperfit"  # of a schema


def is_own_table(path: Path) -> bool:
    """Whether a file is a table of results, by what it says of itself; run.json is one too."""
    with suppress(OSError):
        if not path.is_file():
            return False
        with path.open("rb") as file:
            begin = file.read(_LONGEST)
        if begin.startswith(b"PAR1"):
            return _says_so(path)
        if path.name == "run.json":
            return b'"schema_version"' in path.read_bytes()[:4096]
        return begin.startswith(_HEADINGS)
    return False


def _says_so(path: Path) -> bool:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return _FACTS in (pq.read_schema(path).metadata or {})
    except (OSError, pa.ArrowInvalid):
        return False  # whoever reads it says what is wrong
