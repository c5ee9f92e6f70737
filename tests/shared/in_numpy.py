"""Models with kernels in NumPy: of a scene with few calls of its kernels, a C compiler takes most of the time."""

from functools import partial

import symgen

build = partial(symgen.build, backend="numpy")
