"""How often the intervals of forces and clicks cover the true ones.

    python -m tests.adjustment.click_coverage --fits 200

Every one is a campaign by the paper's procedure over three settings with 4 N of noise behind the
30 Hz filter; R_m3 comes from the first of them and the friction from all.
"""

import argparse

import numpy as np

from damperfit.adjustment.clicks import clicks, compare_settings
from damperfit.adjustment.force_at import Stage, force_at
from damperfit.conditioning import condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.identification import identify
from damperfit.tested.setting import Setting
from damperfit.uncertainty import assess
from tests.uncertainty.coverage import SETTINGS, MadeUpCampaign, clean_logs, noisy


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fits", type=int, default=50)
    n = parser.parse_args().fits
    made_up = MadeUpCampaign()
    logs = clean_logs(made_up)
    clean = [condition(log) for log in logs]
    rng = np.random.default_rng(4)
    force_hits, click_hits = [], []
    truth = [Stage(Setting.of(setting), reference_parameters(setting)) for setting in SETTINGS]
    for _ in range(n):
        campaign = identify(noisy(made_up, logs, clean, rng), PURDY_DAMPER)
        found = compare_settings(campaign, assess(campaign, PURDY_DAMPER), PURDY_DAMPER)
        speeds = sorted({one.speed for one in found.forces})
        true = force_at(truth, PURDY_DAMPER, speeds)
        force_hits.append(
            [a.low <= b.force <= a.high for a, b in zip(found.forces, true, strict=True)]
        )
        click_hits.append(
            [a.low <= b.change <= a.high for a, b in zip(found.clicks, clicks(true), strict=True)]
        )
    print(f"forces: covered {100.0 * np.mean(force_hits):.1f} %, by place", end=" ")
    print(*np.round(100.0 * np.mean(force_hits, axis=0)).astype(int))
    print(f"clicks: covered {100.0 * np.mean(click_hits):.1f} %, by place", end=" ")
    print(*np.round(100.0 * np.mean(click_hits, axis=0)).astype(int))


if __name__ == "__main__":
    main()
