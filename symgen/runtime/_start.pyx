# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The binding of starts in the core: assembly of a linkage and consistent velocities."""

from typing import TYPE_CHECKING

import numpy as np

from libc.string cimport memcpy

from symgen.runtime._core cimport Core, Memory, at_least, functions_of, kernel_of, memory_of

from symgen.runtime._core import DOUBLE

if TYPE_CHECKING:
    from symgen.runtime.kernels.evaluate import Evaluator
    from symgen.runtime.kernels.library import Library

#: Outcomes of a step of the assembly.
STARTED, ON_THE_WAY, UNASSEMBLED, TOO_TOLERANT = _STARTED, _ON_THE_WAY, _UNASSEMBLED, _TOO_TOLERANT
OTHER_SIDE = _OTHER_SIDE
#: The largest assembly tolerance over the size of the linkage.
MOST = MOST_TOLERANCE  # type: float


def size_of_points(const double[:, ::1] positions) -> float:
    """Return the size of a linkage [m] by the positions of its points, (points, axes).

    It is twice their largest distance from their mean, which no rotation changes; NaN if a position is not finite.
    """
    cdef const start_api *api = (<Core>DOUBLE).api.start
    if not positions.shape[0] or not 0 < positions.shape[1] <= 3:
        raise ValueError(f"expected positions with 1 to 3 axes, got {positions.shape[0]} with {positions.shape[1]}")
    return api.size(positions.shape[0], positions.shape[1], &positions[0, 0])


cdef class Starter:
    """The assembly of one linkage with scratch memory; one object per thread.

    Parameters
    ----------
    evaluator
        The :class:`~symgen.runtime.kernels.evaluate.Evaluator` of the equations of motion.
    share
        The assembly tolerance of the scene applies where it exceeds this part of the size of the linkage.
    q
        The drawn coordinates [m].
    """

    def __init__(self, evaluator: Evaluator, double share, const double[::1] q):
        cdef Core core = DOUBLE
        d = evaluator.description
        self.library, self.p = evaluator.library, evaluator.parameters
        addresses = self.library.addresses
        self.functions.assembly, self.functions.points = kernel_of(addresses, "assembly"), kernel_of(addresses, "points")
        self.functions.constraints = kernel_of(addresses, "constraints")
        self.functions.jacobian = kernel_of(addresses, "constraint_jacobian")
        self.functions.drift = kernel_of(addresses, "velocity_constraints")
        self.functions.rates, self.functions.mass = kernel_of(addresses, "start_velocity"), kernel_of(addresses, "mass_matrix")
        self.functions.momentum = kernel_of(addresses, "start_momentum")
        self.functions.metric = kernel_of(addresses, "metric")
        self.sizes.n, self.sizes.m = d.coordinates, len(d.constraints)
        at_least("coordinates", q.shape[0], self.sizes.n)
        self.sizes.tolerance, self.sizes.share, self.sizes.size = d.assembly_tolerance, share, d.size
        for name in ("assembly", "points", "constraints", "constraint_jacobian", "velocity_constraints",
                     "start_velocity", "mass_matrix", "start_momentum", "metric"):
            info = evaluator.find(name)
            if info is None:
                continue
            self.sizes.work = max(self.sizes.work, info.work_size)
            self.sizes.out = max(self.sizes.out, info.out_size)
            rows = info.blocks[0].shape[0]
            if name == "assembly":
                self.sizes.rows = rows
            elif name == "points":
                self.sizes.points, self.sizes.axes = d.drawn, info.blocks[0].shape[1]
            elif name == "start_velocity":
                self.sizes.prescribed = rows
        self.api = core.api.start
        self.memory = memory_of(self.api.start_struct, self.api.bytes(&self.sizes))
        self.core = <start *>self.memory.structure
        self.api.bind(self.core, &self.sizes, &self.functions, &self.p[0], self.memory.at)
        memcpy(self.core.q, &q[0], self.sizes.n * sizeof(double))
        self.api.begin(self.core)

    cdef object copied(self, const double *numbers, Py_ssize_t count):
        found = np.empty(count)
        cdef double[::1] to = found
        if count:
            memcpy(&to[0], numbers, count * sizeof(double))
        return found

    @property
    def at(self) -> float:
        """The present fraction of the path from the drawing to the prescribed lengths."""
        return self.core.at

    @property
    def q(self) -> Array:
        """Coordinates [m] at this fraction."""
        return self.copied(self.core.q, self.sizes.n)

    def advance(self) -> int:
        """Take one step along the path; return its outcome."""
        cdef int status
        with nogil:
            status = self.api.advance(self.core)
        return status

    def close(self) -> int:
        """Close the linkage at its start from the present coordinates; return the outcome."""
        self.core.at, self.core.side = 1.0, 0
        return self.advance()

    def velocities(self, redundant: Sequence[int]) -> tuple[Array, Array, Array, float] | None:
        """Return velocities of least kinetic energy, the errors of the independent constraints and of the prescribed
        velocities, and the largest right-hand side of these rows, each in m/s; None if the mass matrix is not positive
        definite."""
        cdef char[::1] dropped = np.zeros(self.sizes.m + 1, dtype=np.int8)
        cdef Py_ssize_t kept
        if self.functions.mass == NULL or (self.sizes.m and (self.functions.jacobian == NULL or self.functions.drift == NULL)):
            raise ValueError("expected a model with the kernels of velocities at the start")
        for row in redundant:
            dropped[row] = 1
        kept = self.api.velocities(self.core, &dropped[0])
        if kept < 0:
            return None
        u = self.copied(self.core.u, self.sizes.n)
        of_start = self.copied(self.core.miss + kept, self.sizes.prescribed)
        return u, self.copied(self.core.miss, kept), of_start, self.core.fastest


cdef class StartLanes:
    """The assembly of variants of one linkage in SIMD lanes; one object per thread.

    Parameters
    ----------
    like
        The assembly of one variant, with at least as many rows as coordinates.
    library
        Kernels of the equations of motion, which take vectors.
    lanes, parameters
        Numbers of a vector, and of tunable parameters.
    """

    cdef start *core
    cdef Memory memory
    cdef const start_api *api
    cdef start_sizes sizes
    cdef start_kernels functions
    cdef Py_ssize_t lanes, parameters
    cdef object library

    def __init__(self, Starter like, library: Library, Py_ssize_t lanes, Py_ssize_t parameters):
        self.library, self.sizes, self.lanes, self.parameters = library, like.sizes, lanes, parameters
        self.api = functions_of(lanes).starts
        self.sizes.m, self.sizes.prescribed = 0, 0
        self.sizes.parameters, self.sizes.derived = parameters, library.derived
        own = library.addresses
        self.functions.setup, self.functions.drawn = kernel_of(own, "setup"), kernel_of(own, "drawn")
        self.functions.assembly, self.functions.points = kernel_of(own, "assembly"), kernel_of(own, "points")
        if self.functions.drawn == NULL or self.functions.assembly == NULL or self.functions.points == NULL:
            raise ValueError("expected the kernels of an assembly")
        if not 0 < self.sizes.n <= self.sizes.rows:
            raise ValueError(f"expected {self.sizes.n} rows of the assembly or more, got {self.sizes.rows}")
        self.memory = memory_of(self.api.start_struct, self.api.bytes(&self.sizes))
        self.core = <start *>self.memory.structure
        self.api.bind(self.core, &self.sizes, &self.functions, NULL, self.memory.at)

    def assembled(self, const double[:, ::1] values) -> tuple[Array, NDArray[np.uint8]]:
        """Assemble the linkage for each row of parameters; return coordinates (runs, n) and a flag (runs,).

        Without the flag the coordinates are undefined, and the linkage must be assembled alone.
        """
        cdef Py_ssize_t runs = values.shape[0], w = self.lanes, padded = (runs + w - 1) // w * w, first = 0
        if values.shape[1] != self.parameters or not runs:
            raise ValueError(f"expected rows of {self.parameters} parameters")
        own = np.minimum(np.arange(padded), runs - 1)  # idle lanes repeat the last run
        q, found = np.empty((padded, self.sizes.n)), np.zeros(padded, dtype=np.uint8)
        cdef const double[:, ::1] rows = np.ascontiguousarray(np.asarray(values)[own]).reshape(padded, self.parameters)
        cdef double[:, ::1] to_q = q
        cdef unsigned char[::1] to_found = found
        cdef double none = 0.0
        with nogil:
            while first < padded:
                self.api.assemble(self.core, &rows[first, 0] if self.parameters else &none, &to_q[first, 0], &to_found[first])
                first += w
        return q[:runs], found[:runs]
