"""What damperfit has written itself, so that nobody fits its results as if they were measured."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import TYPE_CHECKING

from damperfit.damper.purdy.parameters import QUANTITIES
from damperfit.io.files import open_regular
from damperfit.units.quantities import units_of

if TYPE_CHECKING:
    from pathlib import Path


# How the tables in CSV begin, as far as their settings are of one adjuster.
_HEADINGS = (
    f"setting,{QUANTITIES[0].name},".encode(),
    b"setting,log,mse_percent,",
    *(  # in whichever units they were asked for
        f"setting,speed_{unit.replace('/', '_per_')},stroke,".encode()
        for unit in units_of("velocity")
    ),
    *(  # of `export --to csv`
        f"setting,speed_{unit.replace('/', '_per_')},force_".encode()
        for unit in units_of("velocity")
    ),
    b"setting,log,stretch,kind,",
    b"serial,damper,date,setting,",
)
# How a line of --log-file begins: time with zone, level, process.
_LOGGED = re.compile(
    rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d [A-Z]+ +damperfit\[\d+\] "
)
# How the text files of `export` that end as logs do begin: about the tables, tables of simulators.
_EXPORTED = re.compile(rb"(?:#1\n# |#INFOFILE[^\n]*\n## )?damperfit [^\n:]+: results, setting ")
_UNIT = re.compile(rb" \[[^\],;\n]*\]")  # behind a heading, as `export` writes it
_BEGIN = 256  # bytes; no heading is longer, and no beginning of a line of --log-file
_FACTS = b"damperfit"  # of a schema


def is_own_table(path: Path) -> bool:
    """Whether a file is a table of results, by what it says of itself; run.json is one too.

    So is what --log-file wrote, and what `export` wrote of tables and text.
    """
    with suppress(OSError):
        if not path.is_file():
            return False
        with open_regular(path) as file:
            begin = file.read(_BEGIN)
        if begin.startswith(b"PAR1"):
            return _says_so(path)
        if path.name == "run.json":
            with open_regular(path) as file:
                return b'"schema_version"' in file.read(4096)
        if _LOGGED.match(begin) or _EXPORTED.match(begin):
            return True
        heading = _UNIT.sub(b"", begin.partition(b"\n")[0]).replace(b";", b",")
        return heading.startswith(_HEADINGS) or _is_of_model(heading)
    return False


def _is_of_model(begin: bytes) -> bool:
    """Whether a table begins with a setting and quantities of a model: results, or truth."""
    first, *headings = begin.decode("ascii", "replace").split(",")[:3]
    if first != "setting" or len(headings) < 2:
        return False
    from damperfit.damper.model import MODELS

    names = {one.name for kind in MODELS.values() for one in kind().quantities}
    return headings[0] in names and headings[1].strip() in names


def is_own_log_file(path: Path) -> bool:
    """Whether a file begins as --log-file writes it.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    with open_regular(path) as file:
        return _LOGGED.match(file.read(_BEGIN)) is not None


def _says_so(path: Path) -> bool:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return _FACTS in (pq.read_schema(path).metadata or {})
    except (OSError, pa.ArrowInvalid):
        return False  # whoever reads it says what is wrong
