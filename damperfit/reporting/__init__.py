"""Tables, text, figures and pages of a run, for people; each module is imported by its name."""
