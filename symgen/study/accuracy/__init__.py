"""Errors of compiled kernels against their original matrices."""
