"""A whole run of `identify`: logs in, fits, judgement, run.json, a set of files out."""
