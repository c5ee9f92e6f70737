"""Results: labelled arrays with units, drift and provenance."""
