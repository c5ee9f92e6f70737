"""The truth for kernels, as the package has it; tests read it by these names."""

from symgen.symbolic.exact import DIGITS, relative_error
from symgen.symbolic.exact import Exact as Oracle

__all__ = ["DIGITS", "Oracle", "relative_error"]
