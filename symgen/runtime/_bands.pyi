"""Banded systems; see ``_bands.pyx``. It has no part for Python."""
