"""held.toml: which test notices each named limit when it is raised, and which when lowered."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from tests.limits.finding import Limit, find_constants, find_limits

__all__ = ["HELD", "Held", "Table", "limits_of", "read_table"]

HELD = Path(__file__).with_name("held.toml")


@dataclass(frozen=True)
class Held:
    """The tests of one limit: the case that a higher limit would judge otherwise, and a lower."""

    raised: str
    lowered: str
    by: float | None = None  # the factor that they notice, where it is not the usual one
    why: str = ""  # they do not notice less

    @property
    def tests(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((self.raised, self.lowered)))


@dataclass(frozen=True)
class Table:
    held: dict[str, Held]
    exempt: dict[str, str]


def read_table(path: Path) -> Table:
    rows = tomllib.loads(path.read_text(encoding="utf-8"))
    held: dict[str, Held] = {}
    exempt: dict[str, str] = {}
    for file, limits in rows.items():
        for name, said in limits.items():
            key = f"{file}:{name}"
            if "exempt" in said:
                exempt[key] = said["exempt"]
            else:
                held[key] = Held(
                    **{
                        k: f"tests/{v}" if k in {"raised", "lowered"} else v
                        for k, v in said.items()
                    }
                )
    return Table(held, exempt)


def limits_of(root: Path, table: Table) -> dict[str, Limit]:
    """Return what is compared with something, and what the table says is held besides."""
    constants = find_constants(root)
    besides = {name: constants[name] for name in table.held if name in constants}
    return {**find_limits(root), **besides}
