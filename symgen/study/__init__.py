"""Studies: parameters of driven loops, and other solvers on the same kernels."""

from symgen.study.reference import SOLVERS, reference
from symgen.study.running import StudyReport, run_studies

__all__ = ["SOLVERS", "StudyReport", "reference", "run_studies"]
