"""Types of arrays of numbers and of indices."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
#: Numbers with tangents.
Dual = NDArray[Any]
