# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The binding of driven linkages in the core, followed in time without forces."""

import numpy as np

from libc.stdint cimport uintptr_t

from symgen.runtime._core cimport Core, at_least, kernel_of, memory_of

from symgen.calls import raise_failure
from symgen.runtime._core import DOUBLE

cdef class Blocks:
    """Groups of a linkage with n coordinates and m constraints, as arrays for C.

    ``out`` is the size of the result of the kernel ``closure``.
    """

    def __init__(self, groups, Py_ssize_t n, Py_ssize_t m, Py_ssize_t out):
        self.of.count, self.of.squares = len(groups.starts) - 1, groups.squares
        self.of.filled, self.of.couplings = len(groups.entries), len(groups.coupling_columns)
        if self.of.count < 0 or len(groups.rows) != n or len(groups.columns) != n:
            raise ValueError(f"expected the groups of {n} coordinates, got {groups!r}")
        for starts, end in ((groups.starts, n), (groups.coupling_starts, self.of.couplings)):
            if starts[0] != 0 or starts[len(starts) - 1] != end or (np.diff(starts) < 0).any():
                raise ValueError(f"expected starts that rise from 0 to {end}, got {starts!r}")
        if len(groups.coupling_starts) != n + 1:
            raise ValueError(f"expected {n + 1} starts of couplings, got {groups.coupling_starts!r}")
        self.starts = _checked(groups.starts, n + 1)
        self.rows, self.columns = _checked(groups.rows, m), _checked(groups.columns, n)
        limits = (self.of.squares + self.of.couplings, out, m, n)
        columns = np.array(groups.entries, dtype=np.intp).reshape(-1, 4).T
        checked = [_checked(column, limit)[:-1] for column, limit in zip(columns, limits)]
        self.entries = np.append(np.stack(checked, axis=1), 0)
        self.coupling_starts = _checked(groups.coupling_starts, self.of.couplings + 1)
        self.coupling_columns = _checked(groups.coupling_columns, n)
        self.of.starts, self.of.rows, self.of.columns = &self.starts[0], &self.rows[0], &self.columns[0]
        self.of.entries = &self.entries[0]
        self.of.coupling_starts, self.of.coupling_columns = &self.coupling_starts[0], &self.coupling_columns[0]


cdef class Kinematics:
    """The constraints of one driven linkage with scratch memory; one object per thread.

    Parameters
    ----------
    evaluator
        The :class:`~symgen.runtime.kernels.evaluate.Evaluator` of the kernels ``closure`` and
        ``acceleration_rhs``.
    groups
        The constraint Jacobian of independent rows in block triangular form: a
        :class:`~symgen.runtime.rods.following.groups.Groups`.
    length
        Size of the linkage [m].
    forces
        The Evaluator of the kernel ``balance``; None without requested multipliers.
    """

    cdef kinematics *core
    cdef Memory memory
    cdef const kinematics_table *api
    cdef readonly Py_ssize_t n, m
    cdef object libraries
    cdef const double[::1] p, balance_p
    cdef Blocks blocks

    def __init__(self, evaluator, groups, double length, forces=None):
        cdef kinematic_kernels functions
        cdef kinematic_sizes wanted
        cdef Core core = DOUBLE
        d = evaluator.description
        wanted.n, wanted.m, wanted.length = d.coordinates, len(d.constraints), length
        self.n, self.m, self.libraries = wanted.n, wanted.m, [evaluator.library]
        self.p = evaluator.parameters
        own = evaluator.library.addresses
        functions.closure, functions.gamma = kernel_of(own, "closure"), kernel_of(own, "acceleration_rhs")
        functions.balance, self.balance_p = NULL, self.p
        if functions.closure == NULL or functions.gamma == NULL:
            raise ValueError("expected a model with constraints")
        called = [evaluator.info(k) for k in ("closure", "acceleration_rhs")]
        if forces is not None:
            functions.balance, self.balance_p = kernel_of(forces.library.addresses, "balance"), forces.parameters
            self.libraries.append(forces.library)
            called.append(forces.info("balance"))
            if functions.balance == NULL:
                raise ValueError("expected the kernels of forces with a kernel 'balance'")
        wanted.work = max([k.work_size for k in called] + [wanted.n])
        wanted.out = max([k.out_size for k in called] + [wanted.n])
        self.blocks = Blocks(groups, wanted.n, wanted.m, evaluator.info("closure").out_size)
        self.api = <const kinematics_table *>core.api.kinematics
        self.memory = memory_of(self.api.kinematics_struct, self.api.bytes(&wanted, &self.blocks.of))
        self.core = <kinematics *>self.memory.structure
        self.api.bind(self.core, &wanted, &functions, &self.blocks.of, &self.p[0], &self.balance_p[0], self.memory.at)

    def follow(self, double t, const double[::1] q, const double[::1] times):
        """Follow the linkage from a pose q at t through monotone times.

        Returns
        -------
        numpy.ndarray
            Coordinates, their rates and second rates at each time reached, shape (reached, 3, n). Times beyond a pose
            near a singular constraint Jacobian are not reached.
        """
        cdef Py_ssize_t count = times.shape[0], reached
        rows = np.zeros((count + 1, 3 * self.n))
        cdef double[:, ::1] into = rows
        at_least("coordinates", q.shape[0], self.n)
        if count == 0:
            return rows[:0].reshape(0, 3, self.n)
        with nogil:
            reached = self.api.follow(self.core, t, &q[0], &times[0], count, &into[0, 0])
        raise_failure()
        return rows[:reached].reshape(reached, 3, self.n)

    def multipliers(self, const double[::1] times, const double[:, :, ::1] states):
        """Return the multipliers of the constraints at closed poses from ``follow``.

        Returns
        -------
        tuple
            Multipliers, shape (done, m), zero for constraints that follow from others; the least pivot of the Jacobian
            over the greatest and the largest error of the equations [N], shape (done, 2). The computation ends at the
            first nearly singular pose.
        """
        cdef Py_ssize_t count = times.shape[0], done = 0
        found, sound = np.zeros(count * self.m + 1), np.zeros((count + 1, 2))
        cdef double[::1] into = found
        cdef double[:, ::1] quality = sound
        if states.shape[0] != count or states.shape[1] != 3 or states.shape[2] != self.n or len(self.libraries) < 2:
            raise ValueError(f"expected states of shape {(count, 3, self.n)} and kernels of forces")
        if count:
            with nogil:
                done = self.api.multipliers(
                    self.core, &times[0], &states[0, 0, 0], count, &into[0], &quality[0, 0]
                )
            raise_failure()
        return found[:done * self.m].reshape(done, self.m), sound[:done]


cdef object _checked(numbers, Py_ssize_t limit):
    """Return numbers that are at least 0 and below a limit, with a spare entry, so that the first has an address."""
    found = np.array([*numbers, 0], dtype=np.intp)
    if (found < 0).any() or (found >= max(limit, 1)).any():
        raise ValueError(f"expected numbers from 0 to below {limit}, got {numbers!r}")
    return found
