"""Small fleets: two settings of the sample runs, given to dampers of several names."""

from pathlib import Path

import pandas as pd
import pytest

from damperfit.cli.main import main
from tests.kept_fits import _fits_are_kept  # noqa: F401

SAMPLES = Path(__file__).parents[2] / "sample_runs"


@pytest.fixture(scope="session")
def texts():
    """Two short logs: four cycles of settings 1 and 10."""
    found = {}
    for number in (1, 10):
        name = f"setting_{number:02d}.csv"
        lines = (SAMPLES / name).read_text().splitlines(keepends=True)
        n_head = next(k for k, line in enumerate(lines) if line[0].isdigit())
        found[name] = ("".join(lines[:n_head]), "".join(lines[n_head : n_head + 1900]))
    return found


def put(folder: Path, texts, serial: str = "") -> None:
    """Write the logs of one damper."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (head, rows) in texts.items():
        said = f"# serial: {serial}\n" if serial else ""
        (folder / name).write_text(said + head + rows)


@pytest.fixture
def three(tmp_path, texts):
    """Three dampers, a folder each."""
    for name in ("D1", "D2", "D10"):
        put(tmp_path / "logs" / name, texts)
    return tmp_path / "logs"


class Here:
    """The work of a fleet done in this process, which is quicker for a test than another one."""

    def __init__(self, _number: int = 1) -> None:
        self.n_begun = 0

    def result(self, act, item):
        try:
            return act(item)
        except Exception as error:  # noqa: BLE001 - as another process hands it over
            return error

    def each(self, act, items, *, cancelled=lambda: False):
        for item in items:
            if cancelled():
                return
            self.n_begun += 1
            yield item, self.result(act, item)


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr("damperfit.workers.Processes", Here)


def run(*arguments: object) -> int:
    return main(["fleet", *map(str, arguments)])


def table_of(folder: Path) -> pd.DataFrame:
    return pd.read_parquet(folder / "_fleet" / "fleet.parquet")
