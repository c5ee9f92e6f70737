# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The binding of derivatives of runs: tangents of steps, and transposes of explicit steps."""

from typing import TYPE_CHECKING

import numpy as np

from symgen.calls import raise_failure
from symgen.runtime._core cimport (
    KernelEquations, Integrable, Memory, Scheme, at_least, equations, kernel_of, kernel_t, held_parameters, memory_of,
    scheme as scheme_t,
)
from symgen.runtime._headers cimport (
    _SLOPES_OF, variation_kernels, variation_sizes, variations, variation_behaviour, variation_api,
)

if TYPE_CHECKING:
    from symgen.runtime.integrate.integrators.method import Integrator
    from symgen.runtime.kernels.loop_description import LoopDescription
    from symgen.runtime.kernels.evaluate import Evaluator
    from symgen.runtime.kernels.library import Library


cdef class Variations:
    """Derivatives along steps by directions: parameters, and numbers on which the initial state depends."""

    cdef Integrable equations
    cdef Scheme scheme
    cdef object library, kept
    cdef variation_sizes sizes
    cdef variation_kernels functions
    cdef const variation_api *api
    cdef variations *core
    cdef Memory memory
    cdef bint is_explicit
    cdef double nothing

    cdef int take(self, Integrable equations, method, description, library, Py_ssize_t parameters, Py_ssize_t columns) except -1:
        """Store equations, method and kernels."""
        if equations.of.api.real_bytes != sizeof(double) or equations.extra:
            raise ValueError("expected equations in double precision without the work of loads")
        if method.kind not in ("explicit", "radau", "alpha"):
            raise ValueError("expected an explicit method, Radau's or generalized-alpha")
        if method.kind != "explicit" and columns < 2 * equations.n:
            raise ValueError("expected the state among the directions of an implicit method")
        self.is_explicit = method.kind == "explicit"
        self.equations, self.scheme, self.library = equations, equations.of.scheme(method), library
        addresses = self.library.addresses
        self.functions.stage, self.functions.closing = kernel_of(addresses, "stage"), kernel_of(addresses, "closing")
        self.functions.setup = kernel_of(addresses, "setup")
        self.sizes.columns, self.sizes.width = columns, 1
        self.sizes.parameters, self.sizes.derived = parameters, library.derived
        for info in description.kernels:
            self.sizes.work = max(self.sizes.work, info.work_size)
            self.sizes.out = max(self.sizes.out, info.out_size)
        return 0

    cdef int made(self, bint loop) except -1:
        """Set up the core."""
        cdef const variation_api *api = self.equations.of.api.variations
        cdef const variation_behaviour *of = api.loops if loop else api.rods
        self.api = api
        self.memory = memory_of(
            api.variations_struct, api.bytes(of, self.equations.core, &self.scheme.filled, &self.sizes)
        )
        self.core = <variations *>self.memory.structure
        api.bind(self.core, of, self.equations.core, &self.scheme.filled, &self.sizes, &self.functions, self.memory.at)
        return 0

    cdef object array(self, double *at, shape):
        """Return an array over memory of the core."""
        cdef Py_ssize_t count = 1
        for size in shape:
            count *= size
        if count == 0:
            return np.zeros(shape)
        found = np.asarray(<double[:count]>at)
        return found.reshape(shape)

    def forward(self, const double[::1] t, const double[:, ::1] y, const double[:, ::1] references, moved: Array,
                summed: Array) -> tuple[int, int]:
        """Propagate derivatives of the state, (2n, columns), and of integrals, (integrals, columns), along the steps
        between these times; return the status and the number of steps taken."""
        moving = self.array(self.core.moved, (2 * self.equations.n, self.sizes.columns))
        summing = self.array(self.core.summed, (self.sizes.integrals, self.sizes.columns))
        moving[:], summing[:] = moved, summed
        found = self.along(0, t, y, references)
        moved[:], summed[:] = moving, summing
        return found

    def backward(self, const double[::1] t, const double[:, ::1] y, const double[:, ::1] references, seed: Array,
                 weights: Array, gradient: Array) -> tuple[int, int]:
        """Propagate a seed (2n) of the last state, and weights of the integrals, back to the first state (explicit
        steps only); add to the gradient by the directions. Return the status and the number of steps taken."""
        if not self.is_explicit:
            raise ValueError("expected an explicit method")
        seeds = self.array(self.core.seed, (2 * self.equations.n,))
        gradients = self.array(self.core.gradient, (self.sizes.columns,))
        seeds[:], gradients[:] = seed, gradient
        self.array(self.core.weights, (self.sizes.integrals,))[:] = weights
        found = self.along(1, t, y, references)
        seed[:], gradient[:] = seeds, gradients
        return found

    def parts(self, const double[::1] t, const double[:, ::1] y, const double[:, ::1] references, double rtol,
              double atol, double[::1] parts) -> tuple[int, int]:
        """Write for steps whose entry is not zero the number of equal parts, a real number, in which the explicit method,
        with one direction, has the tolerance. Return the status and the number of steps."""
        cdef const double *held = self.held(t, y, references)
        cdef long taken = 0, steps = t.shape[0] - 1
        cdef int status = 0
        at_least("numbers of parts", parts.shape[0], max(steps, 1))
        if not self.is_explicit or self.sizes.columns != 1:
            raise ValueError("expected an explicit method and one direction")
        with nogil:
            status = self.api.count_parts(self.core, steps, &t[0], &y[0, 0], held, rtol, atol, &parts[0], &taken)
        raise_failure()
        return status, taken

    def fill(self, const double[::1] t, double[:, ::1] y, const double[:, ::1] references,
             const char[::1] known) -> None:
        """Write the states after explicit steps from the states before them where they are not known."""
        cdef const double *held = self.held(t, y, references)
        at_least("marks of known states", known.shape[0], t.shape[0])
        if not self.is_explicit:
            raise ValueError("expected an explicit method")
        with nogil:
            self.api.fill(self.core, t.shape[0] - 1, &t[0], &y[0, 0], held, &known[0])
        raise_failure()

    cdef const double *held(self, const double[::1] t, const double[:, ::1] y, const double[:, ::1] references) except NULL:
        """Return the references of steps after checks of the sizes of all arrays."""
        cdef Py_ssize_t steps = t.shape[0] - 1
        at_least("times", t.shape[0], 1)
        at_least("states", y.shape[0], steps + 1)
        at_least("numbers in a state", y.shape[1], 2 * self.equations.n)
        if y.shape[1] != 2 * self.equations.n:
            raise ValueError(f"expected states of {2 * self.equations.n} numbers, got {y.shape[1]}")
        if not held_parameters(&self.equations.core.sizes):
            return &self.nothing
        at_least("rows of references", references.shape[0], max(steps, 1))
        at_least("references", references.shape[1], held_parameters(&self.equations.core.sizes))
        return &references[0, 0]

    cdef object along(self, bint back, const double[::1] t, const double[:, ::1] y, const double[:, ::1] references):
        cdef long taken = 0, steps = t.shape[0] - 1
        cdef int status
        cdef const double *held = self.held(t, y, references)
        with nogil:
            if back:
                status = self.api.backward(self.core, steps, &t[0], &y[0, 0], held, &taken)
            else:
                status = self.api.forward(self.core, steps, &t[0], &y[0, 0], held, &taken)
        raise_failure()
        return status, taken

    @property
    def columns(self) -> int:
        """Number of directions."""
        return self.sizes.columns

    @property
    def sums(self) -> Array:
        """The integrals along all steps taken, (integrals,)."""
        return self.array(self.core.sums, (self.sizes.integrals,)).copy()


cdef class LinkageVariations(Variations):
    """Derivatives along runs of linkages.

    Parameters
    ----------
    equations
        The :class:`~symgen.runtime._core.KernelEquations` of the run, in doubles, without the work of loads.
    method
        The integrator of the run: explicit, Radau's or generalized-alpha.
    evaluator
        The :class:`~symgen.runtime.kernels.evaluate.Evaluator` of the analysis ``variation``.
    places
        Row, column and place (entries, 3) of the slopes of the residual, Phi, dPhi/dt and the integrands; columns are
        (q, u), (a, lambda), then the directions.
    columns
        Number of directions; of an implicit method the last 2n are the state.
    """

    def __init__(self, KernelEquations equations, method: Integrator, evaluator: Evaluator,
                 places: Sequence[NDArray[np.int_]], Py_ssize_t columns):
        cdef long[:, ::1] of
        cdef Py_ssize_t i
        self.take(equations, method, evaluator.description, evaluator.library, len(evaluator.parameter_values), columns)
        addresses = self.library.addresses
        self.functions.integrands = kernel_of(addresses, "integrands")
        self.functions.integrand_slopes = kernel_of(addresses, "integrand_slopes")
        if equations.m and self.functions.closing == NULL:
            raise ValueError("expected the kernel 'closing' of a model with constraints")
        for info in evaluator.description.kernels:
            if info.name == "integrands":
                self.sizes.integrals = len(info.blocks)
        whole = equations.n + equations.m
        rows = whole, equations.m, equations.m, self.sizes.integrals
        self.kept = [np.ascontiguousarray(each, dtype="l").reshape(-1, 3) for each in places]
        for i in range(_SLOPES_OF):
            of = self.kept[i]
            limits = rows[i], 2 * equations.n + whole + columns, self.sizes.out
            if of.shape[0] and ((self.kept[i] < 0).any() or (self.kept[i] >= limits).any()):
                raise ValueError(f"expected (row, column, place) below {limits} for each slope")
            self.sizes.entries[i] = of.shape[0]
            self.sizes.places[i] = &of[0, 0] if of.shape[0] else NULL
        self.made(False)


cdef class LoopVariations(Variations):
    """Derivatives along runs of loops of joints.

    Parameters
    ----------
    equations
        The :class:`~symgen.runtime._loop.LoopEquations` of the run, in doubles, without the work of loads.
    method
        The explicit integrator of the run.
    description, library
        Description and library of the analysis ``loop_variation``.
    width
        Length of the vectors of these kernels.
    directions
        Number of the parameter that each direction changes; -1 where it changes none.
    """

    def __init__(self, Integrable equations, method: Integrator, description: LoopDescription, library: Library,
                 Py_ssize_t width, directions: Sequence[int]):
        cdef long[::1] of = np.array([*directions, -1], dtype="l")
        self.take(equations, method, description, library, equations.core.sizes.parameters, of.shape[0] - 1)
        addresses = self.library.addresses
        self.functions.rates, self.functions.prescribed = kernel_of(addresses, "rates"), kernel_of(addresses, "prescribed")
        if self.functions.stage == NULL or self.functions.closing == NULL or self.functions.rates == NULL:
            raise ValueError("expected the kernels 'stage', 'closing' and 'rates'")
        if any(not -1 <= i < self.sizes.parameters for i in directions):
            raise ValueError(f"expected numbers of parameters below {self.sizes.parameters}, got {[*directions]}")
        self.kept, self.sizes.directions, self.sizes.width = of, &of[0], width
        self.made(True)
