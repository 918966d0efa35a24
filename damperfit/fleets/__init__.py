"""Many dampers: one Parquet part each, written by the worker that fits it, never done twice.

LOGS --sources--> files --tasks--> DamperTask (one damper) --workers--> part
     parts --collect--> one table --survey--> medians, bands, who is far off --> page
"""
