"""What an earlier run found in an object is trusted where the same version found it."""

from pathlib import Path

import pyarrow as pa
import pytest

from damperfit import __version__
from damperfit.fleets import sources as unchanged
from damperfit.fleets.parts import part_path, write_part
from damperfit.fleets.sources import FleetLog, KnownObject

PLACE = "s3://bucket/runs/a.csv"


def part(folder: Path, version: str, key: str) -> None:
    seen = {PLACE: ["etag", "abc", f"told by {version}"]}
    table = pa.table({"setting": ["1"]})
    write_part(part_path(folder, "D1", key), table, {"version": version, "seen": seen})


@pytest.mark.parametrize("versions", [[], ["0.0.1"], [__version__], [__version__, "0.0.1"]])
def test_only_this_version_is_believed_whose_a_log_is(
    versions: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for key, version in zip("ab", versions, strict=False):
        part(tmp_path, version, key)
    monkeypatch.setattr(unchanged, "_stamp_of", lambda _place: "etag")
    (found,) = unchanged.recognised([FleetLog(PLACE, "a.csv")], tmp_path)
    own = KnownObject("etag", "abc", f"told by {__version__}")
    assert found.seen == (own if __version__ in versions else None)
