"""MDF files as asammdf writes them, from the child that reads them: loading it takes a second."""

import io
import pickle
from collections.abc import Sequence
from functools import cache

import numpy as np

from damperfit.io import ReadOptions
from damperfit.io.child_process import ChildAnswer, ChildReader, ask_child
from damperfit.io.files import Source

_WRITER = ChildReader("MDF", "mdf", "asammdf", f"{__name__}:answer")


def written(*groups: tuple[np.ndarray, Sequence[tuple[str, str, np.ndarray]]]) -> bytes:
    """Groups of signals at times, each a name, a unit and its values."""
    return _asked_for(pickle.dumps(groups))


@cache
def _asked_for(data: bytes) -> bytes:
    source = Source("log.mf4", "log.mf4", data, "")
    (content,) = ask_child(_WRITER, source, ReadOptions()).parts
    return content


def answer(data: bytes, limit: int) -> ChildAnswer:
    import asammdf

    sink = io.BytesIO()
    with asammdf.MDF(version="4.10") as file:
        for time, signals in pickle.loads(data):  # noqa: S301 - our own
            file.append([_signal(asammdf, time, *one) for one in signals])
        file.save(sink, overwrite=True)
    return ChildAnswer(None, [sink.getvalue()])


def _signal(asammdf, time, name, unit, values):
    text = {"encoding": "utf-8"} if values.dtype.kind == "S" else {}
    return asammdf.Signal(values, time, unit, name, **text)
