# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The binding of driven linkages, followed in time without forces: single ones, and variants in the lanes of vectors."""

from typing import TYPE_CHECKING

import numpy as np

from symgen.runtime._core cimport Core, Memory, at_least, functions_of, interrupted, kernel_of, kernel_t, memory_of
from symgen.runtime._headers cimport (
    kinematics, kinematic_kernels, kinematic_groups, kinematic_sizes, kinematic_extremes, kinematic_task,
    kinematics_api,
)

from symgen.calls import raise_failure
from symgen.runtime._core import DOUBLE

if TYPE_CHECKING:
    from symgen.runtime.kernels.description import Description
    from symgen.runtime.kernels.evaluate import Evaluator
    from symgen.runtime.kernels.library import Library
    from symgen.runtime.rods.following.groups import Groups


cdef class Blocks:
    """Groups of a linkage with n coordinates and m constraints, as arrays for C.

    ``out`` is the size of the result of the kernel ``closure``.
    """

    cdef kinematic_groups of
    cdef const Py_ssize_t[::1] starts, rows, columns, entries, coupling_starts, coupling_columns

    def __init__(self, groups: Groups, Py_ssize_t n, Py_ssize_t m, Py_ssize_t out):
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


cdef class Steps:
    """The steps of driven linkages with their kernels and memory; one object per thread."""

    cdef kinematics *core
    cdef Memory memory
    cdef const kinematics_api *api
    cdef kinematic_sizes sizes
    cdef kinematic_kernels functions
    cdef list libraries
    cdef Blocks blocks

    cdef int bound(self, motion, groups, forces, called) except -1:
        """Bind the kernels of description and library; ``called`` are all of them, ``closure`` first."""
        d, library = motion
        self.sizes.n, self.sizes.m, self.libraries = d.coordinates, len(d.constraints), [library]
        self.functions.closure = kernel_of(library.addresses, "closure")
        self.functions.gamma = kernel_of(library.addresses, "acceleration_rhs")
        if self.functions.closure == NULL or self.functions.gamma == NULL:
            raise ValueError("expected a model with constraints")
        if forces is not None:
            library = forces[1]
            self.functions.balance = kernel_of(library.addresses, "balance")
            if self.functions.balance == NULL:
                raise ValueError("expected kernels of forces with a kernel 'balance'")
            self.libraries.append(library)
        self.sizes.work = max([k.work_size for k in called] + [self.sizes.n + self.sizes.m])
        self.sizes.out = max([k.out_size for k in called] + [self.sizes.n])
        self.blocks = Blocks(groups, self.sizes.n, self.sizes.m, called[0].out_size)
        self.memory = memory_of(self.api.kinematics_struct, self.api.bytes(&self.sizes, &self.blocks.of))
        self.core = <kinematics *>self.memory.structure
        self.api.bind(self.core, &self.sizes, &self.functions, &self.blocks.of, self.memory.at)
        return 0


cdef class Kinematics(Steps):
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

    cdef readonly Py_ssize_t n, m
    cdef double length
    cdef const double[::1] p, balance_p

    def __init__(self, evaluator: Evaluator, groups: Groups, double length, forces: Evaluator | None = None):
        self.api, self.length = (<Core>DOUBLE).api.kinematics, length
        self.p, self.balance_p = evaluator.parameters, (forces or evaluator).parameters
        called = [evaluator.info(k) for k in ("closure", "acceleration_rhs")] + ([forces.info("balance")] if forces else [])
        of_forces = (forces.description, forces.library) if forces else None
        self.bound((evaluator.description, evaluator.library), groups, of_forces, called)
        self.n, self.m = self.sizes.n, self.sizes.m

    def follow(self, double t, const double[::1] q, const double[::1] times) -> Array:
        """Follow the linkage from a pose q at t through strictly monotone times.

        Returns
        -------
        numpy.ndarray
            Coordinates, their rates and second rates at each time reached, shape (reached, 3, n). Times beyond a pose
            near a singular constraint Jacobian are not reached.
        """
        cdef kinematic_task task
        cdef Py_ssize_t count = times.shape[0], reached = 0
        rows = np.zeros((count + 1, 3 * self.n))
        cdef double[:, ::1] into = rows
        at_least("coordinates", q.shape[0], self.n)
        if count:
            task.t, task.parameters, task.q, task.lengths, task.times = t, &self.p[0], &q[0], &self.length, &times[0]
            task.count, task.rows, task.reached, task.extremes = count, &into[0, 0], &reached, NULL
            with nogil:
                self.api.follow(self.core, &task)
            raise_failure()
        return rows[:reached].reshape(reached, 3, self.n)

    def multipliers(self, const double[::1] times, const double[:, :, ::1] states) -> tuple[Array, Array]:
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
                done = self.api.multipliers(self.core, &self.p[0], &self.balance_p[0], &times[0], &states[0, 0, 0], count,
                                            &into[0], &quality[0, 0])
            raise_failure()
        return found[:done * self.m].reshape(done, self.m), sound[:done]


cdef class KinematicLanes(Steps):
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

    cdef readonly Py_ssize_t lanes

    def __init__(self, motion: tuple[Description, Library], Py_ssize_t lanes, groups: Groups,
                 forces: tuple[Description, Library] | None = None):
        d, library = motion
        self.lanes, self.api = lanes, functions_of(lanes).kinematics
        self.sizes.parameters, self.sizes.derived = len(d.tunable), library.derived
        self.sizes.rank_tolerance, self.sizes.links = d.rank_tolerance, len(d.links)
        self.functions.setup, self.functions.points = kernel_of(library.addresses, "setup"), kernel_of(library.addresses, "points")
        if self.functions.points == NULL or d.coordinates < 1:
            raise ValueError("expected a linkage with points")
        called = [d.kernel("closure"), d.kernel("acceleration_rhs"), d.kernel("points")]
        self.sizes.coordinates = called[2].out_size // 2
        if forces is not None:
            f, loads = forces
            self.functions.joints = kernel_of(loads.addresses, "joint_forces")
            self.functions.setup_forces, self.sizes.derived_forces = kernel_of(loads.addresses, "setup"), loads.derived
            if self.functions.joints == NULL:
                raise ValueError("expected kernels of forces with a kernel 'joint_forces'")
            called += [f.kernel("balance"), f.kernel("joint_forces")]
            self.sizes.joint_forces = called[4].out_size
        self.bound(motion, groups, forces, called)

    cdef Py_ssize_t filled(self, Py_ssize_t runs):
        """Return the number of runs that fill all lanes: idle lanes repeat the last run."""
        return (runs + self.lanes - 1) // self.lanes * self.lanes

    cdef object followed(self, kinematic_task *task, kinematic_extremes *e, double t, const double[:, ::1] parameters,
                         const double[:, ::1] q, const double[::1] lengths, const double[::1] times):
        """Carry out a task with room for all lanes, or its extremes; return the number of times reached."""
        cdef Py_ssize_t runs = parameters.shape[0], parameter_count = self.sizes.parameters, n = self.sizes.n, first = 0
        cdef Py_ssize_t count = times.shape[0], forces = self.sizes.joint_forces, w = self.lanes, padded = self.filled(runs)
        if count < 1 or runs < 1 or parameters.shape[1] != parameter_count or q.shape[0] != runs or q.shape[1] != n or lengths.shape[0] != runs:
            raise ValueError(f"expected times, and one or more rows of {parameter_count} parameters and of {n} coordinates")
        own, reached = np.minimum(np.arange(padded), runs - 1), np.zeros(padded, dtype=np.intp)
        cdef const double[:, ::1] all_parameters = np.ascontiguousarray(np.asarray(parameters)[own]).reshape(padded, parameter_count)
        cdef const double[:, ::1] all_q = np.ascontiguousarray(np.asarray(q)[own])
        cdef const double[::1] all_lengths = np.asarray(lengths)[own]
        cdef Py_ssize_t[::1] to_reached = reached
        cdef double none = 0.0
        task.t, task.times, task.count, task.extremes = t, &times[0], count, e
        with nogil:
            while first < padded and not interrupted():
                task.parameters = &all_parameters[first, 0] if parameter_count else &none
                task.q, task.lengths, task.reached = &all_q[first, 0], &all_lengths[first], &to_reached[first]
                self.api.follow(self.core, task)
                first += w
                if e == NULL:
                    task.rows, task.forces = task.rows + w * count * 3 * n, task.forces + w * count * forces
                else:
                    e.rows, e.closure, e.steady = e.rows + w * 4 * forces, e.closure + w, e.steady + w
        raise_failure()
        return reached[:runs]

    def follow(self, double t, const double[:, ::1] parameters, const double[:, ::1] q, const double[::1] lengths,
               const double[::1] times) -> tuple[Array, Array, Indices]:
        """Follow a linkage for each row of parameters from its pose, a row of q, at t through monotone times.

        ``lengths`` are the sizes of the linkages [m].

        Returns
        -------
        tuple
            Coordinates, their rates and second rates at each time, shape (runs, times, 3, n); the joint forces there
            (runs, times, forces); and the number of times reached (runs,), fewer if the single :class:`Kinematics` ends
            as well: later rows are undefined.
        """
        cdef Py_ssize_t runs = parameters.shape[0], count = times.shape[0], n = self.sizes.n, forces = self.sizes.joint_forces
        cdef kinematic_task task
        states, joints = np.empty(self.filled(runs) * count * 3 * n + 1), np.empty(self.filled(runs) * count * forces + 1)
        cdef double[::1] to_states = states, to_joints = joints
        task.rows, task.forces = &to_states[0], &to_joints[0]
        reached = self.followed(&task, NULL, t, parameters, q, lengths, times)
        return (
            states[:runs * count * 3 * n].reshape(runs, count, 3, n), joints[:runs * count * forces].reshape(runs, count, forces),
            reached,
        )

    def extremes(self, double t, const double[:, ::1] parameters, const double[:, ::1] q, const double[::1] lengths,
                 const double[::1] times, const unsigned char[::1] recorded, const Py_ssize_t[::1] starts,
                 const unsigned char[::1] wanted, const Py_ssize_t[:, ::1] links,
                 double turn) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_]]:
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
        cdef Py_ssize_t runs = parameters.shape[0], count = times.shape[0], forces = self.sizes.joint_forces
        cdef Py_ssize_t padded = self.filled(runs)
        cdef kinematic_task task
        cdef kinematic_extremes e
        if recorded.shape[0] != count or starts.shape[0] < 1 or links.shape[1] != 2:
            raise ValueError(f"expected {count} flags, starts of vectors, and pairs of points")
        if np.min(starts) < 0 or np.max(starts) > forces or np.any(np.diff(starts) < 1):
            raise ValueError(f"expected increasing starts of vectors up to {forces}")
        if wanted.shape[0] != starts.shape[0] - 1 or links.shape[0] > self.sizes.links:
            raise ValueError(f"expected flags of {starts.shape[0] - 1} vectors, and at most {self.sizes.links} links")
        if links.shape[0] and not 0 <= np.min(links) <= np.max(links) <= self.sizes.coordinates - 2:
            raise ValueError(f"expected points among {self.sizes.coordinates} coordinates")
        rows, violation, steady = np.empty((padded, 4, forces)), np.empty(padded + 1), np.zeros(padded + 1, dtype=np.uint8)
        cdef double[:, :, ::1] to_rows = rows
        cdef double[::1] to_violation = violation
        cdef unsigned char[::1] to_steady = steady
        e.rows, e.closure, e.steady = &to_rows[0, 0, 0], &to_violation[0], &to_steady[0]
        e.recorded, e.starts, e.vectors = &recorded[0], &starts[0], starts.shape[0] - 1
        e.wanted = &wanted[0] if e.vectors else NULL
        e.links, e.link_count, e.turn = &links[0, 0] if links.shape[0] else NULL, links.shape[0], turn
        reached = self.followed(&task, &e, t, parameters, q, lengths, times)
        return rows[:runs], violation[:runs], reached == count, steady[:runs].astype(bool)


cdef object _checked(numbers, Py_ssize_t limit):
    """Return numbers that are at least 0 and below a limit, with a spare entry, so that the first has an address."""
    found = np.array([*numbers, 0], dtype=np.intp)
    if (found < 0).any() or (found >= max(limit, 1)).any():
        raise ValueError(f"expected numbers from 0 to below {limit}, got {numbers!r}")
    return found
