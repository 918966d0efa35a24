"""Many dampers: one Parquet part each, written by whoever fits it, and never done twice.

LOGS --sources--> files --tasks--> DamperTask (one damper) --engine--> one_damper --> part
     parts --collect--> one table
"""
