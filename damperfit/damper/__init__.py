"""The physics of the damper, in SI floats only: quantities, models, valves, rig, compiled core.

The theory stands in ``network`` (passages, mounting, friction) and in the modules of ``purdy``,
with the paper's slips: ``parameters`` (symbols, closed forms).
"""
