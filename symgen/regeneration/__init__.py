"""Committed kernels under ``generated/``: their sources, and detection of outdated kernels."""
