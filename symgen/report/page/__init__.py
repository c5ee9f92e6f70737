"""HTML pages, plots and drawings."""
