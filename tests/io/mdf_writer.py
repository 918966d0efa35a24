"""MDF files as asammdf writes them, from the child that reads them: loading it takes a second."""

import io
import pickle
from collections.abc import Sequence
from functools import cache

import numpy as np

from damperfit.io import ReadOptions
from damperfit.io.child_process import ChildReader, ask_child
from damperfit.io.files import Source

_WRITER = ChildReader("MDF", "mdf", "asammdf", f"{__name__}:answer")


def written(*groups: tuple[np.ndarray, Sequence[tuple[str, str, np.ndarray]]]) -> bytes:
    """Groups of signals at times, each a name, a unit and its values."""
    return _asked_for(pickle.dumps(groups))


@cache
def _asked_for(data: bytes) -> bytes:
    source = Source("log.mf4", "log.mf4", data, "")
    return ask_child(_WRITER, source, ReadOptions())


def answer(data: bytes, limit: int) -> bytes:
    import asammdf

    sink = io.BytesIO()
    with asammdf.MDF(version="4.10") as file:
        for time, signals in pickle.loads(data):  # noqa: S301 - our own
            file.append([_signal(asammdf, time, *one) for one in signals])
        file.save(sink, overwrite=True)
    return sink.getvalue()


def _signal(asammdf, time, name, unit, values):
    text = {"encoding": "utf-8"} if values.dtype.kind == "S" else {}
    return asammdf.Signal(values, time, unit, name, **text)
