from typing_extensions import Buffer

def simulate(
    geometry: Buffer,
    parameters: Buffer,
    displacement: Buffer,
    velocity: Buffer,
    which: Buffer,
    pressures: Buffer,
    masses: Buffer,
    force: Buffer,
    sensitivities: Buffer,
    interval: float,
    tolerance: float,
    dead_band: float,
    max_steps_per_sample: int,
    /,
) -> tuple[int, int, int, int, int]: ...
