"""By how much a clipped log bends the numbers of a fit, and how low an MSE it leaves.

    python -m tests.uncertainty.clipped_logs

A twin tube of `rig_like` under a cam crank, two speeds, the faster one cut off at a share of its
largest force. `LIMITS.clipped_percent` of `uncertainty/grades.py` is chosen by this.
"""

from __future__ import annotations

import numpy as np

from damperfit.conditioning import condition
from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.valve_dampers import TwinTube
from damperfit.identification import FitOptions, identify
from damperfit.recording import Recording
from damperfit.tested.setting import Setting
from tests.rig_like.rig import Body, Channels, Valve, crank, logged

TRUTH = {
    "rebound_opening": 7e5, "rebound_slope": 3e6, "rebound_bleed": 4e4, "compression_slope": 5e6,
    "k_s": 7e5, "f_f": 40.0,
}  # fmt: skip
BODY = Body(
    "twin_tube",
    Valve(bleed=4e4, opening=7e5, slope=3e6),
    Valve(bleed=1.4e4, opening=3e5, slope=5e6),
    rod=16e-3, piston=30e-3, length=100e-3, gas_pressure=3e5, gas_volume=100e-6, gas_exponent=1.3,
    bulk=1.2e9, stiffness=7e5, friction=40.0, presliding=4e-6,
)  # fmt: skip
DAMPER = TwinTube(
    rod_diameter=16e-3, piston_diameter=30e-3, chamber_1_length=0.1, chamber_2_length=0.1,
    gas_pressure=3e5, gas_volume=100e-6, gas_exponent=1.3, oil_density=850.0,
    mounting=Mounting(FIT, NONE, NONE),
)  # fmt: skip


def main() -> None:
    """Print a line for each share of the largest force that is left."""
    logs = [
        logged(BODY, crank(frequency, 0.03, cycles), Channels(noise=4.0, jitter=8e-6), seed)
        for seed, (frequency, cycles) in enumerate(((1.2, 6), (2.5, 8)))
    ]
    for left in (1.0, 0.995, 0.99, 0.98, 0.97, 0.95, 0.9):
        tops = (np.inf, left * logs[1].force.max() if left < 1.0 else np.inf)
        traces = [
            condition(
                Recording(f"{top}.csv", "", "", Setting.of(1), log.time, log.displacement,
                          np.minimum(log.force, top))
            )
            for log, top in zip(logs, tops, strict=True)
        ]  # fmt: skip
        found = [one for one in traces[1].findings if one.name == "force_clipping"]
        share = max((one.value or 0.0 for one in found), default=0.0)
        (fit,) = identify(traces, DAMPER, FitOptions("plain")).fits
        off = ", ".join(
            f"{name} {100.0 * (getattr(fit.parameters, name) / true - 1.0):+.1f} %"
            for name, true in TRUTH.items()
        )
        print(f"{share:.2g} % clipped: MSE {fit.mse_percent:.3f} %, {off}", flush=True)


if __name__ == "__main__":
    main()
