"""Parameter studies of driven loops: every combination over the whole range, as plots and tables."""

from symgen.study.running import StudyReport, run_studies

__all__ = ["StudyReport", "run_studies"]
