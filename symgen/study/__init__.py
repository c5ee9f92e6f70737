"""Accuracy and speed of compiled models."""

from symgen.study.speed.reference import SOLVERS, reference

__all__ = ["SOLVERS", "reference"]
