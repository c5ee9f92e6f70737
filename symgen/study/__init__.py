"""Accuracy, speed and stability of compiled models."""

from symgen.study.speed.reference import SOLVERS, reference

__all__ = ["SOLVERS", "reference"]
