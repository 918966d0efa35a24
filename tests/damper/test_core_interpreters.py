"""The compiled core in several interpreters of one process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from damperfit.damper import _core

# In a process of its own: NumPy says of itself that it is not made for this.
_IN_ANOTHER = """
import sys
try:
    import _interpreters as interpreters
except ImportError:
    import _xxsubinterpreters as interpreters
core, root = sys.argv[1:]
alone = f'''
import importlib.util
spec = importlib.util.spec_from_file_location("_core", {core!r})
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
try:
    module.simulate_network(*[b""] * 11, 1.0, 1.0, False, 1.0, 1.0, 1)
except (BufferError, ValueError) as error:
    assert "bytes" in str(error) or "writable" in str(error), error
'''
whole = f'''
import sys, warnings
warnings.simplefilter("ignore")
sys.path.insert(0, {root!r})
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.simulation import simulate, sine_motion
motion = sine_motion(0.032, 1.5, cycles=2, sample_rate=500)
peak = simulate(reference_parameters(10), PURDY_DAMPER, motion).force.max()
assert 1500.0 < peak < 1600.0, peak
'''
def run(code, *how):
    one = interpreters.create(*how)
    failed = getattr(interpreters, "exec", interpreters.run_string)(one, code)
    assert not failed, failed
    interpreters.destroy(one)
is_old = sys.version_info < (3, 12)
for turn in range(3):
    run(alone)  # with a lock of its own from 3.12 on
if is_old:  # from 3.12 on NumPy refuses
    run(whole)
"""


def test_other_interpreters_of_a_process_have_a_core_of_their_own() -> None:
    root = str(Path(__file__).parents[2])
    command = [sys.executable, "-c", _IN_ANOTHER, str(_core.__file__), root]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
