"""Where the options of a run come from: the defaults, then a file, then the command line."""
