# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""dy/dt of a linkage or loop, for external solvers: called from Python, or from C by a function pointer."""

import numpy as np

from cpython.buffer cimport (
    PyBUF_C_CONTIGUOUS, PyBUF_FORMAT, PyBUF_SIMPLE, PyBuffer_Release, PyObject_CheckBuffer, PyObject_GetBuffer,
)
from libc.math cimport rint
from libc.stdint cimport uintptr_t
from libc.string cimport memcpy

from symgen.calls import FAILURES, as_doubles, raise_failure
from symgen.errors import ModelError, shown
from symgen.runtime._core cimport _DONE, Integrable, equations, kernel_of, kernel_t

#: A quarter of a revolution [rad], of which references of angles in loads are multiples.
cdef double _QUARTER = 1.57079632679489661923


cdef void _entry(double t, const double *y, double *dy, void *user_data) noexcept nogil:
    _derivative(<Rhs>user_data, t, y, dy)


cdef void _derivative(Rhs f, double t, const double *y, double *dy) noexcept nogil:
    cdef equations *e = f.core
    _wind(f, y)
    e.of.derivative(e, t, y, dy)
    if f.windings:
        f.turning(&t, y, y + e.n, e.p, e.out, dy + e.dim)


cdef void _wind(Rhs f, const double *y) noexcept nogil:
    """Set the references of angles in loads by the angles behind a state, which have revolutions."""
    cdef equations *e = f.core
    cdef double *reference = e.p + f.first + f.count
    cdef bint moved = False
    cdef double near
    cdef Py_ssize_t k
    for k in range(f.windings):
        near = rint(y[e.dim + k] / _QUARTER) * _QUARTER
        if reference[k] != near:
            reference[k], moved = near, True
    if moved and e.kernels.setup != NULL:
        e.kernels.setup(NULL, NULL, NULL, e.p, NULL, e.p + e.sizes.parameters)


cdef class Rhs:
    """The right-hand side dy/dt = f(t, y) of a mechanism: see :func:`symgen.runtime.model.rhs.right_hand_side`."""

    cdef Integrable equations
    cdef equations *core
    cdef Py_ssize_t windings
    cdef kernel_t turning
    cdef object size
    cdef readonly object start  # type: Array
    cdef readonly object at  # type: Callable[[Any], Array]
    cdef readonly object inputs  # type: tuple[str, ...]
    cdef double[::1] parameter_values, passed
    cdef Py_ssize_t first, count
    cdef bint replaced

    def __init__(self, Integrable equations, begin: Any, at: Callable[[Any], Array], inputs: tuple[str, ...] = (),
                 Py_ssize_t first=0, addresses: Mapping[str, int] = {}):
        if equations.of.api.real_bytes != sizeof(double):
            raise ValueError("expected equations in double precision")
        self.equations, self.core, self.at, self.start = equations, equations.core, at, at(begin)
        self.turning = kernel_of(addresses, "winding_rates")
        self.windings = 0 if self.turning == NULL else equations.core.sizes.windings  # those of loops are balls
        self.size = (equations.dim + self.windings,)
        if self.start.shape != self.size:
            raise ValueError(f"expected a start of {self.size[0]} numbers, got {self.start.shape}")
        self.parameter_values, self.passed = equations.parameters.copy(), equations.parameters.copy()
        self.inputs, self.first, self.count = tuple(inputs), first, len(inputs)
        if not 0 <= first <= self.parameter_values.shape[0] - len(self.inputs):
            raise ValueError(f"expected {len(self.inputs)} inputs from {first} on among {self.parameter_values.shape[0]} parameters")

    cdef object _checked(self, y):
        """Return a state as a contiguous array."""
        row = as_doubles(y)
        parts, more = "(q, u)", ""
        if self.windings:
            parts = "(q, u, angles in loads)"
            more = "\n  rhs.at(state) returns one, with the revolutions of these angles."
        if row is None:
            raise ModelError(f"expected a state y = {parts} of {self.size[0]} real numbers, got {shown(y)}{more}")
        if row.shape != self.size:
            raise ModelError(f"expected a state y = {parts} of {self.size[0]} numbers, got shape {row.shape}{more}")
        return row

    cdef int bind(self, y, Py_buffer *to) except -1:
        """Give access to a state. An array of doubles is used without a check by NumPy, which takes as long as a
        kernel."""
        if PyObject_CheckBuffer(y):
            try:
                PyObject_GetBuffer(y, to, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT)
            except (BufferError, ValueError):
                pass
            else:
                if to.ndim == 1 and to.shape[0] == self.equations.dim + self.windings and to.format[0] == b"d" and to.format[1] == 0:
                    return 0
                PyBuffer_Release(to)
        return PyObject_GetBuffer(self._checked(y), to, PyBUF_SIMPLE)

    cdef int put(self, u) except -1:
        """Set the inputs; by default, their values in the model."""
        cdef double[::1] values = self.parameter_values
        if u is not None:
            row = as_doubles(u)
            if row is None or row.shape != (len(self.inputs),):
                raise ModelError(
                    f"expected {len(self.inputs)} inputs u" + (f" ({', '.join(self.inputs)})" if self.inputs else "")
                    + f", got {shown(u)}"
                )
            values = self.passed
            for i, value in enumerate(row):
                values[self.first + i] = value
        elif not self.replaced:
            return 0
        self.equations.set_parameters(values)
        self.replaced = u is not None
        return 0

    def __call__(self, double t, y: ArrayLike, u: ArrayLike | None = None) -> Array:
        cdef Py_buffer state, slope
        self.put(u)
        self.bind(y, &state)
        made = np.empty(self.size)
        PyObject_GetBuffer(made, &slope, PyBUF_SIMPLE)
        _derivative(self, t, <const double *>state.buf, <double *>slope.buf)
        PyBuffer_Release(&state)
        PyBuffer_Release(&slope)
        if FAILURES.errors:
            raise_failure()
        return made

    def project(self, double t, y: ArrayLike) -> Array:
        """Return the state projected onto the constraints of positions and velocities; angles in loads stay."""
        cdef const double[::1] row = self._checked(y)
        made = np.empty(self.size)
        cdef double[::1] projected = made
        memcpy(&projected[0], &row[0], row.shape[0] * sizeof(double))
        for again in range(2):  # one more projection: with the factor of a distant state, rates are only approximate
            if self.equations.core.of.project(self.equations.core, t, &projected[0]) != _DONE:
                raise ModelError(
                    f"the state at t = {t:g} s cannot be brought onto the constraints: it is too far from "
                    "them, or they lose rank there"
                )
        return made

    def energy(self, double t, y: ArrayLike) -> float:
        """Return kinetic plus potential energy [J]; inputs have none."""
        cdef const double[::1] row = self._checked(y)
        _wind(self, &row[0])
        self.equations.core.of.measure_energy(self.equations.core, t, &row[0])
        return self.equations.core.energies[0] + self.equations.core.energies[1]

    @property
    def low_level(self) -> Any:
        """The right-hand side as a ``scipy.LowLevelCallable``: void (double t, double *y, double *dy, void
        *user_data)."""
        from symgen.runtime.model.rhs import low_level

        return low_level(<uintptr_t>&_entry, <uintptr_t><void *>self, self)

    def __reduce__(self):
        raise TypeError(
            "a right-hand side cannot be copied or pickled: it has scratch memory in compiled code\n"
            "  Copy or pickle the model: model.rhs makes another one."
        )

    def __repr__(self):
        return f"<right-hand side of {self.equations.dim // 2} coordinates and their rates>"
