from typing_extensions import Buffer

def simulate_network(
    body: Buffer,
    numbers: Buffer,
    passages: Buffer,
    displacement: Buffer,
    velocity: Buffer,
    jumps: Buffer,
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
def behind_lag(
    signals: Buffer, result: Buffer, rows: int, a: float, b: float, c: float, /
) -> None: ...
def lag_slope(
    signal: Buffer, behind: Buffer, slope: Buffer, a: float, by_a: float, by_mean: float, /
) -> None: ...
def spline_slopes(samples: Buffer, slopes: Buffer, scratch: Buffer, /) -> None: ...
def between(signal: Buffer, positions: Buffer, values: Buffer, rows: int, /) -> None: ...
def turns(x: Buffer, turns: Buffer, reach: float, /) -> int: ...
def without_smooth(
    lag: Buffer, force: Buffer, columns: Buffer, sums: Buffer, reach: float, kink: float, /
) -> float: ...
def steps(
    lag: Buffer,
    columns: Buffer,
    sums: Buffer,
    delays: Buffer,
    rest: Buffer,
    heights: Buffer,
    scratch: Buffer,
    power: float,
    width: float,
    least: float,
    /,
) -> None: ...
def fold(
    x: Buffer,
    v: Buffer,
    f: Buffer,
    starts: Buffer,
    means: Buffer,
    beside: Buffer,
    room: Buffer,
    /,
) -> None: ...
def triangle(columns: Buffer, triangle: Buffer, width: int, /) -> None: ...
def at_speeds(
    velocity: Buffer,
    speeds: Buffer,
    rows: Buffer,
    counts: Buffer,
    means: Buffer,
    squares: Buffer,
    sign: float,
    /,
) -> None: ...
