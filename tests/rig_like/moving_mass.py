"""What a mass between load cell and damper does to a fit that knows it, and to one that does not.

    python -m tests.rig_like.moving_mass

One damper at 1, 3, 6 and 10 Hz, a force channel that is 4 ms late: errors of openings, mounting and
lag without the mass, with a mass that is fitted, and with one that was weighed.
"""

from collections.abc import Sequence
from dataclasses import replace

from damperfit.conditioning import condition
from damperfit.damper.mounting import FIT, NONE, Mounting
from damperfit.damper.valve_dampers import TwinTube
from damperfit.identification import FitOptions, identify
from damperfit.recording import Trace
from tests.identification.rig import recorded
from tests.rig_like.rig import Body, Channels, Valve, crank, logged

TESTS = ((1.0, 0.025), (3.0, 0.015), (6.0, 0.009), (10.0, 0.0055))  # Hz, m
LAG = 0.004  # s
BODY = Body(
    "twin_tube",
    Valve(bleed=4.2e4, opening=9e5, slope=1.5e7),
    Valve(bleed=9e4, opening=1.1e6, slope=3.2e7),
    check=Valve(slope=2.4e5),
    rod=12.4e-3, piston=30e-3, length=90e-3, gas_pressure=5e5, gas_volume=3.5e-5, bulk=1e9,
    stiffness=6e5, friction=24.0,
)  # fmt: skip
MODEL = TwinTube(
    rod_diameter=BODY.rod, piston_diameter=BODY.piston, chamber_1_length=BODY.length,
    chamber_2_length=BODY.length, gas_pressure=BODY.gas_pressure, gas_volume=BODY.gas_volume,
    gas_exponent=BODY.gas_exponent, oil_density=BODY.density,
)  # fmt: skip
TRUE = {
    "rebound_opening": 9e5, "compression_opening": 1.1e6, "k_s": 6e5, "lag": LAG,
}  # fmt: skip


def loaded_logs(
    mass: float, *, lag: float = LAG, tests: Sequence[tuple[float, float]] = TESTS
) -> list[Trace]:
    """The logs as conditioned, of a rod with this mass in kg."""
    found = []
    for place, (frequency, amplitude) in enumerate(tests):
        channels = Channels(rate=1024.0, jitter=4e-6, offset=-12.0, lag=lag)
        cycles = max(4.3, min(12.3, 4.0 * frequency + 0.3))
        log = logged(replace(BODY, mass=mass), crank(frequency, amplitude, cycles), channels, place)
        name = f"{frequency:g}Hz"
        found.append(condition(recorded(log.displacement, log.force, 1024.0, setting=1, name=name)))
    return found


def errors(traces: list[Trace], mass: str | float, *, lag: str = FIT) -> dict[str, float]:
    """Per cent by name of a fit with that mounting; a fitted mass in kg, the MSE in per cent."""
    model = replace(MODEL, mounting=Mounting(FIT, NONE, lag, mass))
    (fit,) = identify(traces, model, FitOptions("plain")).fits
    numbers = dict(zip(fit.parameters.names, fit.parameters.numbers, strict=True))
    found = {
        name: 100.0 * (numbers[name] / true - 1.0) for name, true in TRUE.items() if name in numbers
    }
    if mass == FIT:
        found["moving_mass"] = numbers["moving_mass"]
    return found | {"mse_percent": fit.mse_percent}


def main() -> None:
    """Print a line for each mass and way to fit."""
    for mass in (0.05, 0.4, 1.0, 2.0):
        traces = loaded_logs(mass)
        for way in (NONE, FIT, mass):
            said = ", ".join(f"{name} {x:.2g}" for name, x in errors(traces, way).items())
            print(f"{mass:g} kg, {way if isinstance(way, str) else 'weighed'}: {said}", flush=True)


if __name__ == "__main__":
    main()
