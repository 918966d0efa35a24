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
    lead: int,
    is_lead_unseen: bool = False,
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
def crossings(
    x: Buffer, v: Buffer, at: Buffer, reach: float, level: float, sign: float, /
) -> int: ...
def tops(
    x: Buffer, v: Buffer, boundaries: Buffer, tops: Buffer, level: float, sign: float, /
) -> None: ...
def turns(x: Buffer, turns: Buffer, reach: float, /) -> int: ...
def passages(x: Buffer, turns: Buffer, at: Buffer, /) -> None: ...
def outstanding(signal: Buffer, result: Buffer, /) -> None: ...
def rank(values: Buffer, rank: int, /) -> float: ...
def harmonics(signal: Buffer, powers: Buffer, mean: float, angle: float, /) -> None: ...
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
def scatter(
    y: Buffer, starts: Buffer, phases: Buffer, folded: Buffer, lags: Buffer, /
) -> float: ...
def beside(
    x: Buffer,
    v: Buffer,
    f: Buffer,
    starts: Buffer,
    products: Buffer,
    room: Buffer,
    n_phases: int,
    /,
) -> None: ...
def cycle_means(y: Buffer, boundaries: Buffer, means: Buffer, /) -> None: ...
def strokes(
    x: Buffer,
    v: Buffer,
    f: Buffer,
    found: Buffer,
    products: Buffer,
    along: Buffer,
    span: float,
    fastest: float,
    /,
) -> None: ...
def rough(y: Buffer, scratch: Buffer, /) -> float: ...
def sort(values: Buffer, room: Buffer, /) -> None: ...
def step(order: Buffer, scratch: Buffer, bar: float, /) -> float: ...
def equal_runs(y: Buffer, begins: Buffer, ends: Buffer, fewest: int, /) -> int: ...
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
def cycle_products(
    residuals: Buffer,
    slopes: Buffer,
    kernel: Buffer,
    products: Buffer,
    room: Buffer,
    n_cycles: int,
    /,
) -> None: ...
def read_numbers(
    text: Buffer,
    wanted: Buffer,
    values: Buffer,
    start: int,
    separator: str,
    decimal: str,
    n_names: int,
    n_fields: int,
    /,
) -> int: ...
