"""Each configuration in configs/ describes a damper that is identified with it."""

from pathlib import Path

import pytest

from damperfit.configuration.loading import load_configuration
from tests.fakes import values_in

CONFIGS = Path(__file__).parents[2] / "configs"
# Our own synthetic values for the two dampers: (r_m1, r_m2, r_m3, k_e, f_f) by setting.
TRUTH = {
    "purdy2000.toml": {
        1: (1.5e4, 2.2e6, 2.597e6, 5.0e8, 50.0),
        2: (2.1e4, 3.5e6, 2.597e6, 5.6e8, 50.0),
        3: (2.8e4, 5.5e6, 2.597e6, 6.2e8, 50.0),
    },
    "slim_race.toml": {
        1: (1.0e4, 1.6e6, 4.5e5, 4.0e8, 35.0),  # at a third of R_m1 they take 20 s to make
        2: (1.3e4, 2.2e6, 4.5e5, 4.4e8, 35.0),
        3: (1.7e4, 3.1e6, 4.5e5, 4.9e8, 35.0),
    },
}


def test_the_papers_configuration_is_the_default() -> None:
    assert load_configuration(CONFIGS / "purdy2000.toml") == load_configuration()


@pytest.mark.parametrize("name", TRUTH)
def test_its_damper_is_found_from_its_logs(run, tmp_path, name) -> None:
    rows = [",".join(map(str, (setting, *row))) for setting, row in TRUTH[name].items()]
    (tmp_path / "truth_in.csv").write_text("\n".join(["setting,r_m1,r_m2,r_m3,k_e,f_f", *rows, ""]))
    config = ("--config", CONFIGS / name)
    noise = ("--force-noise", "0.2N", "--displacement-noise", "0.2um", "--cycles", "8")
    made = run(
        *("samples", "runs", "--settings", "1-3", "--parameters", "truth_in.csv"),
        *("--sample-rate", "1000Hz", *noise, *config),
    )
    assert made.code == 0
    ended = run("identify", "runs/*.csv", *config)
    assert ended.code == 0, ended.err
    found = values_in(tmp_path / "results" / "parameters.parquet")
    for setting, (r_m1, r_m2, r_m3, k_e, f_f) in TRUTH[name].items():
        assert found[setting].r_m1 == pytest.approx(r_m1, rel=2e-3)
        assert found[setting].r_m2 == pytest.approx(r_m2, rel=3e-3)
        assert found[setting].r_m3 == pytest.approx(r_m3, rel=1e-2)
        assert found[setting].k_e == pytest.approx(k_e, rel=1e-2)
        assert found[setting].f_f == pytest.approx(f_f, rel=2e-2)
