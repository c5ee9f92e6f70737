"""Tables, plots, equations and pages for readers."""
