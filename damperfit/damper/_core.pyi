from typing_extensions import Buffer

def simulate_network(
    body: Buffer,
    numbers: Buffer,
    passages: Buffer,
    displacement: Buffer,
    velocity: Buffer,
    which: Buffer,
    pressures: Buffer,
    masses: Buffer,
    force: Buffer,
    sensitivities: Buffer,
    interval: float,
    rounding: float,
    has_floating_piston: bool,
    tolerance: float,
    dead_band: float,
    max_steps_per_sample: int,
    /,
) -> tuple[int, int, int, int, int]: ...
def follow(
    numbers: Buffer,
    layout: Buffer,
    displacement: Buffer,
    velocity: Buffer,
    force: Buffer,
    slopes: Buffer,
    interval: float,
    rounding: float,
    /,
) -> tuple[int, int]: ...
def run_filter(
    sections: Buffer,
    steady: Buffer,
    signal: Buffer,
    result: Buffer,
    scratch: Buffer,
    rows: int,
    pad: int,
    way: int,
    /,
) -> None: ...
def spline_slopes(samples: Buffer, slopes: Buffer, scratch: Buffer, /) -> None: ...
def between(signal: Buffer, positions: Buffer, values: Buffer, rows: int, /) -> None: ...
def crossings(x: Buffer, v: Buffer, at: Buffer, reach: float, /) -> int: ...
def tops(x: Buffer, v: Buffer, boundaries: Buffer, tops: Buffer, /) -> None: ...
def turns(x: Buffer, turns: Buffer, reach: float, /) -> int: ...
def passages(x: Buffer, turns: Buffer, at: Buffer, /) -> None: ...
def fold(
    signal: Buffer, starts: Buffer, phases: Buffer, folded: Buffer, lags: Buffer, rows: int, /
) -> None: ...
def outstanding(signal: Buffer, result: Buffer, /) -> None: ...
def rank(values: Buffer, rank: int, /) -> float: ...
def harmonics(signal: Buffer, powers: Buffer, mean: float, angle: float, /) -> None: ...
