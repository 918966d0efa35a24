"""The physics of the damper, in SI floats only: geometry, parameters, closed forms, compiled core.

The theory, with the paper's slips, stands in the modules of ``purdy``: ``parameters`` (symbols),
``closed_forms`` (incompressible limit and Appendix 2) and ``bulk_modulus`` (Appendix 1).
"""
