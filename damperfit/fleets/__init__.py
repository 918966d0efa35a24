"""Many dampers: one Parquet part each, written by whoever fits it, and never done twice.

LOGS --sources--> files --tasks--> DamperTask (one damper) --workers--> part
     parts --collect--> one table --survey--> medians, bands, who is far off --> page
"""
