"""Text exports of MTS 793 as a controller writes them: one record in many write buffers."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
RATE = 1024.0  # Hz
BUFFER = 1016  # rows; 0.992 s


@dataclass(frozen=True, eq=False)
class Record:
    """What the machine recorded: s, mm, kN."""

    time: FloatArray
    displacement: FloatArray
    force: FloatArray

    def rows(self, start: int, stop: int):
        part = slice(start, stop)
        return Record(self.time[part], self.displacement[part], self.force[part])


def record(seconds: float = 78.0) -> Record:
    """A rest, 13 speeds from 0.2 to 10 Hz at 3 to 4 cycles each without a pause, a slow ramp."""
    n_all = int(seconds * RATE)
    time = np.arange(n_all) / RATE
    displacement = np.zeros(n_all)
    end = 2.0  # s, of the rest
    for f in np.geomspace(0.2, 10.0, 13):
        amplitude = min(25.0, 1000.0 * 0.4 / (2.0 * np.pi * f))  # mm, at most 0.4 m/s
        start, end = end, end + (3 if f < 1.0 else 4) / f
        is_in = (time >= start) & (time < end)
        displacement[is_in] = amplitude * np.sin(2.0 * np.pi * f * (time[is_in] - start))
    ramp = time >= end
    displacement[ramp] = (time[ramp] - end) / 20.0 * 10.0
    v = np.gradient(displacement, time) / 1000.0
    force = 2.0 * v + 0.8 * v * np.abs(v) + 0.03 * np.tanh(v / 0.002) - 0.13
    return Record(time, displacement, force)


def blocks_of(whole: Record, buffer: int = BUFFER) -> list[Record]:
    """The record as it is written, buffer by buffer."""
    return [whole.rows(i, i + buffer) for i in range(0, len(whole.time), buffer)]


def export(blocks: list[Record]) -> str:
    """The file: a line of the format, then header, names, units and rows of each block."""
    lines = ["MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A", ""]
    for block in blocks:
        lines += [
            "Data Acquisition: Timed\t\tTime:\t1.0197\tSec\t3/29/2016 1:54:32 PM",
            "Running Time\tAxial Displacement\tAxial Force",
            "Sec\tmm\tkN",
        ]
        columns = (block.time, block.displacement, block.force)
        rows = zip(*(column.tolist() for column in columns), strict=True)
        lines += [f"{t:.7f}\t{x:.6g}\t{f:.6g}" for t, x, f in rows]
        lines.append("")
    return "\r\n".join(lines) + "\r\n"


def moved_on(block: Record, seconds: float) -> Record:
    """The same rows, logged later."""
    return replace(block, time=block.time + seconds)
