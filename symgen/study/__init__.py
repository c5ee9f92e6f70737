"""Studies: parameter variations, accuracy, speed and stability of compiled models."""

from symgen.study.running import StudyReport, run_studies
from symgen.study.speed.reference import SOLVERS, reference

__all__ = ["SOLVERS", "StudyReport", "reference", "run_studies"]
