"""A reader for a child process that does what its log says: for test_child_process.py."""

import os
import signal
import sys
import time

from damperfit.errors import LogError

_SEEN: list[bytes] = []


def answer(data: bytes, limit: int) -> tuple[int, int, list[bytes]]:
    _SEEN.append(data)
    word, _, rest = data.partition(b" ")
    if word == b"refuse":
        raise LogError("this one is refused")
    if word == b"raise":
        raise RuntimeError("no LogError")
    if word == b"exit":
        os._exit(7)
    if word == b"crash" or (word == b"wears" and len(_SEEN) > 1):
        os.kill(os.getpid(), signal.SIGSEGV)
    if word == b"sleep":
        time.sleep(60.0)
    if word == b"allocate" or (word == b"leak" and len(_SEEN) > 1):
        bytes(int(rest))  # counts, and is never touched
    if word == b"print":
        sys.stdout.write("to the answer?")
        sys.stdout.flush()
        os.write(1, b"to the answer?")
    return os.getpid(), len(_SEEN), [data, b"", bytes(len(data))]
