# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The binding of driven linkages followed in the lanes of vectors."""

import numpy as np

from symgen.runtime._core cimport Core, Memory, interrupted, kernel_of, kernel_t, memory_of
from symgen.runtime._kinematics cimport Blocks, kinematic_groups, kinematics_table

from symgen.calls import raise_failure
from symgen.runtime._core import DOUBLE

cdef extern from "core/kinematic_lanes.h" nogil:
    cdef struct kinematic_lanes:
        pass

    cdef struct kinematic_lane_kernels:
        kernel_t closure, gamma, setup, points, balance, joints, setup_forces

    cdef struct kinematic_lane_sizes:
        Py_ssize_t n, m, work, out, parameters, derived, derived_forces, joint_forces, coordinates, links
        double rank_tolerance

    cdef struct kinematic_lane_extremes:
        const unsigned char *recorded
        const Py_ssize_t *starts
        Py_ssize_t vectors
        const unsigned char *wanted
        const Py_ssize_t *links
        Py_ssize_t link_count
        double turn
        double *rows
        double *closure
        unsigned char *steady

    cdef struct kinematic_lane_task:
        double t
        const double *parameters
        const double *q
        const double *lengths
        const double *times
        Py_ssize_t count
        double *rows
        double *forces
        Py_ssize_t *reached
        const kinematic_lane_extremes *extremes

    cdef struct lanes_table "kinematic_lanes_api":
        Py_ssize_t width
        size_t lanes_struct
        size_t (*bytes)(const kinematic_lane_sizes *, const kinematic_groups *) noexcept nogil
        void (*bind)(kinematic_lanes *, const kinematic_lane_sizes *, const kinematic_lane_kernels *, const kinematic_groups *, void *) noexcept nogil
        void (*follow)(kinematic_lanes *, const kinematic_lane_task *) noexcept nogil


cdef class KinematicLanes:
    """Variants of one driven linkage, followed in SIMD lanes; one object per thread.

    Parameters
    ----------
    motion
        Description and kernels, which take vectors, of ``closure``, ``acceleration_rhs`` and ``points``.
    lanes
        Numbers of a vector.
    groups
        The constraint Jacobian of independent rows in block triangular form: a
        :class:`~symgen.runtime.rods.following.groups.Groups`.
    forces
        Description and kernels of ``balance`` and ``joint_forces``; None without requested forces.
    """

    cdef kinematic_lanes *core
    cdef Memory memory
    cdef const lanes_table *api
    cdef kinematic_lane_sizes sizes
    cdef readonly Py_ssize_t lanes
    cdef object libraries
    cdef Blocks blocks

    def __init__(self, motion, Py_ssize_t lanes, groups, forces=None):
        cdef kinematic_lane_kernels functions
        cdef Core core = DOUBLE
        cdef Py_ssize_t n, m
        d, library = motion
        n, m = d.coordinates, len(d.constraints)
        self.sizes.n, self.sizes.m, self.sizes.parameters = n, m, len(d.tunable)
        self.sizes.derived, self.sizes.rank_tolerance = library.derived, d.rank_tolerance
        self.lanes, self.libraries = lanes, [library]
        self.api = <const lanes_table *>core.api.kinematic_lanes(lanes)
        if self.api == NULL:
            raise ValueError(f"expected vectors of 2, 4 or 8 numbers, got {lanes}")
        own = library.addresses
        functions.closure, functions.gamma = kernel_of(own, "closure"), kernel_of(own, "acceleration_rhs")
        functions.setup, functions.points = kernel_of(own, "setup"), kernel_of(own, "points")
        functions.balance = functions.joints = functions.setup_forces = NULL
        called = [d.kernel("closure"), d.kernel("acceleration_rhs"), d.kernel("points")]
        self.sizes.coordinates, self.sizes.links = called[2].out_size // 2, len(d.links)
        if forces is not None:
            f, loads = forces
            functions.balance, functions.joints = kernel_of(loads.addresses, "balance"), kernel_of(loads.addresses, "joint_forces")
            functions.setup_forces, self.sizes.derived_forces = kernel_of(loads.addresses, "setup"), loads.derived
            if functions.balance == NULL or functions.joints == NULL:
                raise ValueError("expected kernels of forces, 'balance' and 'joint_forces'")
            called += [f.kernel("balance"), f.kernel("joint_forces")]
            self.sizes.joint_forces = f.kernel("joint_forces").out_size
            self.libraries.append(loads)
        if functions.closure == NULL or functions.gamma == NULL or functions.points == NULL or n < 1:
            raise ValueError("expected a model with constraints")
        self.sizes.work = max([k.work_size for k in called] + [n + m])
        self.sizes.out = max([k.out_size for k in called] + [n])
        self.blocks = Blocks(groups, n, m, called[0].out_size)
        self.memory = memory_of(self.api.lanes_struct, self.api.bytes(&self.sizes, &self.blocks.of))
        self.core = <kinematic_lanes *>self.memory.structure
        self.api.bind(self.core, &self.sizes, &functions, &self.blocks.of, self.memory.at)

    cdef tuple padded(self, const double[:, ::1] parameters, const double[:, ::1] q, const double[::1] lengths, Py_ssize_t count):
        """Return parameters, coordinates and lengths for all lanes; idle lanes repeat the last run."""
        cdef Py_ssize_t runs = parameters.shape[0], parameter_count = self.sizes.parameters, n = self.sizes.n
        if count < 1 or runs < 1 or parameters.shape[1] != parameter_count or q.shape[0] != runs or q.shape[1] != n or lengths.shape[0] != runs:
            raise ValueError(f"expected times, and one or more rows of {parameter_count} parameters and of {n} coordinates")
        own = np.minimum(np.arange((runs + self.lanes - 1) // self.lanes * self.lanes), runs - 1)
        return (
            np.ascontiguousarray(np.asarray(parameters)[own]).reshape(len(own), parameter_count),
            np.ascontiguousarray(np.asarray(q)[own]), np.asarray(lengths)[own],
        )

    def follow(self, double t, const double[:, ::1] parameters, const double[:, ::1] q, const double[::1] lengths,
               const double[::1] times):
        """Follow a linkage for each row of parameters from its pose, a row of q, at t through monotone times.

        ``lengths`` are the sizes of the linkages [m].

        Returns
        -------
        tuple
            Coordinates, their rates and second rates at each time, shape (runs, times, 3, n); the joint forces there
            (runs, times, forces); and the number of times reached (runs,), fewer if the single
            :class:`~symgen.runtime._kinematics.Kinematics` ends as well: later rows are undefined.
        """
        cdef Py_ssize_t runs = parameters.shape[0], count = times.shape[0], n = self.sizes.n, w = self.lanes
        cdef Py_ssize_t forces = self.sizes.joint_forces, first, lane, run, parameter_count = self.sizes.parameters
        cdef kinematic_lane_task task
        cdef const double[:, ::1] all_parameters, all_q
        cdef const double[::1] all_lengths
        all_parameters, all_q, all_lengths = self.padded(parameters, q, lengths, count)
        cdef Py_ssize_t padded = all_q.shape[0]
        states, joints = np.empty((padded * count * 3 * n + 1)), np.empty(padded * count * forces + 1)
        reached = np.zeros(padded + 1, dtype=np.intp)
        cdef double[::1] to_states = states, to_joints = joints
        cdef Py_ssize_t[::1] to_reached = reached
        cdef double none = 0.0
        task.t, task.times, task.count, task.extremes = t, &times[0], count, NULL
        with nogil:
            first = 0
            while first < padded and not interrupted():
                task.parameters = &all_parameters[first, 0] if parameter_count else &none
                task.q, task.lengths = &all_q[first, 0], &all_lengths[first]
                task.rows, task.forces = &to_states[first * count * 3 * n], &to_joints[first * count * forces]
                task.reached = &to_reached[first]
                self.api.follow(self.core, &task)
                first += w
        raise_failure()
        return (
            states[:runs * count * 3 * n].reshape(runs, count, 3, n), joints[:runs * count * forces].reshape(runs, count, forces),
            reached[:runs],
        )

    def extremes(self, double t, const double[:, ::1] parameters, const double[:, ::1] q, const double[::1] lengths,
                 const double[::1] times, const unsigned char[::1] recorded, const Py_ssize_t[::1] starts,
                 const unsigned char[::1] wanted, const Py_ssize_t[:, ::1] links, double turn):
        """Follow a linkage as :meth:`follow` does, and return extremes of its joint forces instead of all values.

        Parameters
        ----------
        recorded
            Flag of each time; at least one is set.
        starts
            Index of the first number of each vector of joint forces, and the end of the last.
        wanted
            Requested extremes of each vector, the sum of 2**number; the others are undefined.
        links
            The first coordinates of two points of every link, planar linkages only.
        turn
            Rotation of a link from one time to the next [rad] that counts as small.

        Returns
        -------
        tuple
            Joint forces (runs, 4, forces): greatest, least, where each vector is longest, and last; the largest
            violation of a constraint (runs,); which runs reach the end, and which of these with small rotations only.
        """
        cdef Py_ssize_t runs = parameters.shape[0], count = times.shape[0], n = self.sizes.n, w = self.lanes, first = 0
        cdef Py_ssize_t forces = self.sizes.joint_forces, parameter_count = self.sizes.parameters
        cdef kinematic_lane_task task
        cdef kinematic_lane_extremes e
        cdef const double[:, ::1] all_parameters, all_q
        cdef const double[::1] all_lengths
        all_parameters, all_q, all_lengths = self.padded(parameters, q, lengths, count)
        cdef Py_ssize_t padded = all_q.shape[0]
        if recorded.shape[0] != count or starts.shape[0] < 1 or links.shape[1] != 2:
            raise ValueError(f"expected {count} flags, starts of vectors, and pairs of points")
        if np.min(starts) < 0 or np.max(starts) > forces or np.any(np.diff(starts) < 1):
            raise ValueError(f"expected increasing starts of vectors up to {forces}")
        if wanted.shape[0] != starts.shape[0] - 1 or links.shape[0] > self.sizes.links:
            raise ValueError(f"expected flags of {starts.shape[0] - 1} vectors, and at most {self.sizes.links} links")
        if links.shape[0] and not 0 <= np.min(links) <= np.max(links) <= self.sizes.coordinates - 2:
            raise ValueError(f"expected points among {self.sizes.coordinates} coordinates")
        rows, violation = np.empty((padded, 4, forces)), np.empty(padded)
        reached, steady = np.zeros(padded, dtype=np.intp), np.zeros(padded, dtype=np.uint8)
        cdef double[:, :, ::1] to_rows = rows
        cdef double[::1] to_violation = violation
        cdef Py_ssize_t[::1] to_reached = reached
        cdef unsigned char[::1] to_steady = steady
        cdef double none = 0.0
        task.t, task.times, task.count, task.extremes = t, &times[0], count, &e
        e.recorded, e.starts, e.vectors = &recorded[0], &starts[0], starts.shape[0] - 1
        e.wanted = &wanted[0] if e.vectors else NULL
        e.links, e.link_count, e.turn = &links[0, 0] if links.shape[0] else NULL, links.shape[0], turn
        with nogil:
            while first < padded and not interrupted():
                task.parameters = &all_parameters[first, 0] if parameter_count else &none
                task.q, task.lengths, task.reached = &all_q[first, 0], &all_lengths[first], &to_reached[first]
                e.rows, e.closure, e.steady = &to_rows[first, 0, 0], &to_violation[first], &to_steady[first]
                self.api.follow(self.core, &task)
                first += w
        raise_failure()
        return rows[:runs], violation[:runs], reached[:runs] == count, steady[:runs].astype(bool)
