# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The binding of elastic links in the core: their rigid reference motion and equations."""

from typing import TYPE_CHECKING

import numpy as np

from libc.string cimport memset

from symgen.calls import raise_failure
from symgen.runtime._core cimport (
    Core, Integrable, Memory, Reals, _DONE, at_least, equations, kernel_of, kernel_t, kernels, memory_of,
    sizes as equation_sizes,
)
from symgen.runtime._headers cimport (
    _MOTION, _BLOCKS, _IN_MOTION, _AT_REST, _QUASI_STATIC, MOTION_NAMES, APPLIED_NAMES, BLOCKS_NAMES,
    MATRICES_NAMES, VECTORS_NAMES, SPREAD_NAMES, rigid_motion, motion_kernels, motion_sizes, beam_counts,
    beam_layout, beam_tangents, beams, elastic_api,
)

if TYPE_CHECKING:
    from symgen.runtime.beams.layout import BeamLayout
    from symgen.runtime.elastic.path import RigidMotionTable
    from symgen.runtime.kernels.library import Library


cdef tuple _names(const char *listed):
    return tuple(listed.decode().split())


#: Columns of the kernels ``links`` and ``loads``: see :mod:`symgen.mechanics.elastic.weights`.
MOTION, APPLIED = _names(MOTION_NAMES), _names(APPLIED_NAMES)  # type: tuple[str, ...]
#: Blocks of the kernel ``joints``; matrices and vectors of a superelement, and of a force along it.
BLOCKS, MATRICES = _names(BLOCKS_NAMES), _names(MATRICES_NAMES)  # type: tuple[str, ...]
VECTORS, SPREAD = _names(VECTORS_NAMES), _names(SPREAD_NAMES)  # type: tuple[str, ...]
#: Assembled terms of the equations: see ``beams.h``.
IN_MOTION, AT_REST, QUASI_STATIC = _IN_MOTION, _AT_REST, _QUASI_STATIC


cdef object _doubles(Core of, const void *raw, shape):
    """Return numbers of a core as doubles."""
    found = np.empty(shape)
    cdef double[::1] to = found.reshape(-1)
    if to.shape[0]:
        of.api.narrow(to.shape[0], raw, &to[0], NULL)
    return found


cdef object _indices(const Py_ssize_t *raw, Py_ssize_t count):
    found = np.empty(count, dtype=np.intp)
    cdef Py_ssize_t[::1] to = found
    cdef Py_ssize_t i
    for i in range(count):
        to[i] = raw[i]
    return found


cdef class RigidMotion:
    """The rigid reference motion, without free coordinates, and the kernels of elastic links along it.

    Parameters
    ----------
    equations
        The rigid linkage.
    motion, joints
        The kernels of ``elastic_motion`` and of ``elastic_joints``, kept alive by this object. sizes Sizes of the
        kernels' results: links, joints, shaft, loads, setup and joints_setup.
    t, y
        A time [s] and the state at this time.
    stride
        The longest time [s] over which a state is a good prediction of the next.
    path
        A :class:`symgen.runtime.elastic.path.RigidMotionTable` if the motion was integrated.
    """

    cdef readonly Integrable equations
    cdef const elastic_api *api
    cdef rigid_motion *core
    cdef Memory memory
    cdef motion_sizes sizes
    cdef tuple libraries
    cdef Reals rows, references

    def __init__(self, Integrable equations, motion: Library, joints: Library, sizes: Mapping[str, int], double t,
                 y: ArrayLike, double stride, path: RigidMotionTable | None = None):
        cdef motion_kernels functions
        cdef Reals state = Reals(equations.of, [*y, *np.zeros(equations.extra)])
        if state.count != equations.dim:
            raise ValueError(f"expected a state of {2 * equations.n} numbers, got {len(y)}")
        if min(sizes.values()) < 0:
            raise ValueError(f"expected sizes of the kernels' results, got {sizes!r}")
        self.equations, self.sizes = equations, sizes
        self.api = equations.of.api.elastic
        self.libraries = (motion, joints)
        moving, joining = motion.addresses, joints.addresses
        functions.links, functions.joints = kernel_of(moving, "links"), kernel_of(joining, "joints")
        functions.shaft, functions.loads = kernel_of(moving, "shaft"), kernel_of(moving, "loads")
        functions.setup, functions.joints_setup = kernel_of(moving, "setup"), kernel_of(joining, "setup")
        self.memory = memory_of(self.api.motion_struct, self.api.motion_bytes(equations.core, &self.sizes))
        self.core = <rigid_motion *>self.memory.structure
        self.api.motion_bind(self.core, equations.core, &functions, &self.sizes, stride, self.memory.at)
        self.api.motion_start(self.core, t, state.at)
        if path is not None:
            self.rows = Reals(equations.of, path.rows)
            self.references = Reals(equations.of, path.references)
            at_least("instants of a path", len(path.rows), 2)
            at_least("numbers in the rows of a path", self.rows.count, 3 * equations.n * len(path.rows))
            windings = equations.core.sizes.windings
            at_least("references of angles of a path", self.references.count, windings * len(path.rows))
            if not 0 <= path.absent <= equations.m:
                raise ValueError(f"expected a constraint number of at most {equations.m}, got {path.absent}")
            self.api.motion_follow(self.core, self.rows.at, self.references.at, len(path.rows), path.spacing, path.absent)

    @property
    def t(self) -> float:
        """The present time [s]."""
        return float(_doubles(self.equations.of, self.core.t, ()))

    def save(self) -> bytes:
        """Return the bytes of its memory, and of that of its equations."""
        return self.memory.saved() + self.equations.save()

    def restore(self, const unsigned char[::1] memory) -> None:
        """Restore the bytes of :meth:`save` for the same motion."""
        self.memory.restore(memory)
        self.equations.restore(memory[self.memory.bytes:])

    def evaluate(self, double t) -> tuple[int, Array, Array, Array, Array, Array]:
        """Return the status, the state, and the results of the kernels links, joints, shaft and loads at a time."""
        cdef int status = self.api.motion_at(self.core, t)
        cdef Core of = self.equations.of
        cdef const rigid_motion *seen = self.core
        return (status, _doubles(of, seen.y, 2 * self.equations.n), _doubles(of, seen.motion, self.sizes.links),
                _doubles(of, seen.joined, self.sizes.joints), _doubles(of, seen.shaft, self.sizes.shaft),
                _doubles(of, seen.loads, self.sizes.loads))

    def along(self, times: Array) -> tuple[int, Array, Array, Array, Array]:
        """Return a status, and at rising times states, accelerations with multipliers, motion of links and point loads."""
        cdef Core of = self.equations.of
        cdef Py_ssize_t count = len(times)
        cdef Integrable rigid = self.equations
        sizes = rigid.dim, rigid.n + rigid.m, self.sizes.links, self.sizes.loads
        states, solutions, rows, forces = (np.zeros((count, k)) for k in sizes)
        cdef Reals when = Reals(of, times), y = Reals(of, states), a = Reals(of, solutions)
        cdef Reals x = Reals(of, rows), f = Reals(of, forces)
        cdef int status
        with nogil:
            status = self.api.motion_along(self.core, when.at, count, y.at, a.at, x.at, f.at)
        raise_failure()
        for made in (y, a, x, f):
            (<Reals>made).back()
        return status, states[:, :2 * rigid.n], solutions, rows, forces


cdef int _within(str what, values, Py_ssize_t low, high) except -1:
    """Raise ValueError where an index is below ``low`` or not below ``high``."""
    found = np.asarray(values)
    if (found < low).any() or (found >= high).any():
        raise ValueError(f"expected {what} from {low} to below {high}, got {found.tolist()}")
    return 0


cdef int _check_layout(layout, Py_ssize_t links, Py_ssize_t joined, Py_ssize_t loads) except -1:
    """Raise ValueError if an index of a layout lies outside its arrays or the output of the kernels joints and loads."""
    cdef Py_ssize_t n = layout.unknowns, m = layout.constraints, entries = len(layout.rows)
    sizes, pieces = np.asarray(layout.sizes), len(layout.sizes)
    for what in ("constants_at", "link_of", "joints", "places_at", "slots_at"):
        at_least(what, len(getattr(layout, what)), pieces)
    at_least("loads_at", len(layout.loads_at), links + 1)
    at_least("joint_at", len(layout.joint_at), _BLOCKS)
    at_least("columns", len(layout.columns), entries)
    if not 0 <= m <= n:
        raise ValueError(f"expected at most {n} constraints, got {m}")
    _within("rows", layout.rows, 0, n)
    _within("columns", layout.columns, 0, n)
    inner = layout.inner
    banded = (np.asarray(layout.rows) < inner) & (np.asarray(layout.columns[:entries]) < inner)
    _within("distances from the diagonal", np.abs(layout.rows - layout.columns[:entries])[banded], 0, layout.band + 1)
    _within("places", layout.places, -1, n)
    if m and not 0 <= inner <= n - m or not m and inner != n:
        raise ValueError(f"expected {n} unknowns before those of joints, fewer by {m} constraints at least, got {inner}")
    _within("joint_places", layout.joint_places, -1, n)
    if m:
        _within("joint_places without -1", layout.joint_places[:-1], inner, n)
    _within("slots", layout.slots, -1, entries)
    for what in ("mass_slots", "damping_slots", "stiffness_slots"):  # the last slot is spare
        _within(what, getattr(layout, what)[:-1], 0, entries)
    _within("shaft", [layout.shaft], -1, n)
    _within("shaft_slot", [layout.shaft_slot], -1 if layout.shaft < 0 else 0, entries)
    _within("joint_at", layout.joint_at, 0, joined + 1)
    _within("loads_at", layout.loads_at[:links + 1], 0, loads + 1)
    spread = np.diff(layout.loads_at[:links + 1])
    _within("steps of loads_at", spread, 0, loads + 1)
    if pieces:
        _within("link_of", layout.link_of, 0, links)
        _within("joints", np.reshape(layout.joints, (pieces, -1)), -1, sizes[:, None])
        _within("places_at", layout.places_at, 0, len(layout.places) - sizes + 1)
        _within("slots_at", layout.slots_at, 0, len(layout.slots) - sizes**2 + 1)
        own = sizes * (len(VECTORS) + sizes * len(MATRICES)) + spread[layout.link_of] * sizes * (2 + sizes)
        _within("constants_at", layout.constants_at, 0, len(layout.constants) - own + 1)
    coordinates = len(layout.joint_places) - 1
    if len(layout.damped):
        forces = len(layout.damped) * (int(np.sum(sizes)) + coordinates)
        at_least("constants", len(layout.constants), layout.damped_at + forces)
        if not layout.apart:
            at_least("entries of matrices with damped modes", entries, n * n)
    slots = layout.mass_slots, layout.damping_slots, layout.stiffness_slots
    blocks = [coordinates, *[len(s) - 1 for s in slots], *[m * coordinates] * 3]
    for start, count in zip(layout.joint_at, blocks):
        if count:
            at_least("numbers of the joints kernel", joined, start + count)
    return 0


cdef class _Packed:
    """A validated layout as arrays of the core."""

    cdef beam_layout of
    cdef const double[::1] constants
    cdef list kept

    cdef const Py_ssize_t *keep(self, values) except NULL:
        """Store an array of indices, and return its address."""
        cdef Py_ssize_t[::1] made = np.append(values, -1).astype(np.intp)
        self.kept.append(made)
        return &made[0]


cdef _Packed _packed(layout, RigidMotion motion):
    """Return the arrays of a layout for a rigid motion. The layout stores them, and many equations share them."""
    cdef _Packed made
    key = motion.sizes.links // _MOTION, motion.sizes.joints, motion.sizes.loads // len(APPLIED)
    if key not in layout.packed:
        _check_layout(layout, key[0], key[1], key[2])
        made = _Packed()
        made.kept = []
        made.of.counts = layout.counts
        made.of.sizes, made.of.constants_at = made.keep(layout.sizes), made.keep(layout.constants_at)
        made.of.link_of, made.of.joints = made.keep(layout.link_of), made.keep(layout.joints)
        made.of.places, made.of.places_at = made.keep(layout.places), made.keep(layout.places_at)
        made.of.slots, made.of.slots_at = made.keep(layout.slots), made.keep(layout.slots_at)
        made.of.joint_places, made.of.joint_at = made.keep(layout.joint_places), made.keep(layout.joint_at)
        made.of.mass_slots, made.of.damping_slots = made.keep(layout.mass_slots), made.keep(layout.damping_slots)
        made.of.stiffness_slots = made.keep(layout.stiffness_slots)
        made.of.loads_at = made.keep(layout.loads_at)
        made.of.rows, made.of.columns = made.keep(layout.rows), made.keep(layout.columns)
        made.constants = np.append(layout.constants, 0.0)
        layout.packed[key] = made
    return layout.packed[key]


cdef class BeamEquations(Integrable):
    """The equations of the elastic motion of one linkage; one per thread of work.

    Parameters
    ----------
    motion
        The rigid motion.
    layout
        A :class:`symgen.runtime.beams.layout.BeamLayout`: unknowns, superelements and their places.
    thesis
        Constant-transformation form: the rotation of end displacements and the basis of the constraints are taken as
        constant in time.
    """

    cdef readonly RigidMotion motion
    cdef readonly Py_ssize_t whole
    cdef readonly bint thesis
    cdef const elastic_api *api
    cdef beams *assembly
    cdef _Packed packed
    cdef beam_tangents tangents
    cdef tuple kept

    def __init__(self, RigidMotion motion, layout: BeamLayout, bint thesis):
        cdef _Packed packed = _packed(layout, motion)
        cdef beam_layout wanted = packed.of
        self.motion, self.packed, self.thesis = motion, packed, thesis
        self.of, self.api = motion.equations.of, motion.api
        wanted.thesis = thesis
        self.memory = memory_of(self.api.beams_struct, self.api.beams_bytes(&wanted))
        self.core = <equations *>self.memory.structure
        self.assembly = <beams *>self.core
        self.api.beams_bind(self.assembly, motion.core, &wanted, self.memory.at)
        self.of.api.widen(wanted.counts.constant_count, &packed.constants[0], NULL, self.assembly.constants)
        self.bound(np.zeros(1))
        self.whole = layout.unknowns

    def save(self) -> bytes:
        """Return the bytes of its memory, and of that of the rigid motion."""
        return self.memory.saved() + self.motion.save()

    def restore(self, const unsigned char[::1] memory) -> None:
        """Restore the bytes of :meth:`save` for the same equations."""
        self.memory.restore(memory)
        self.motion.restore(memory[self.memory.bytes:])
        if not self.api.beams_valid(self.assembly):
            raise ValueError("expected indices of equations within their arrays")

    def carry(self, times: Array, weights: Array, rows: Indices, columns: Indices, values: Array) -> None:
        """Let batches carry tangents by parameters: the columns after the first are those of its state.

        ``values`` (parameters, points, numbers) are tangents at rising ``times`` [s], between which the weights
        interpolate: of entries of mass, damping and stiffness at ``rows`` and ``columns``, the load, and the constraints
        between unknowns of joints with two rates.
        """
        cdef double[::1] at = np.array(times, dtype=float), by = np.array(weights, dtype=float)
        cdef double[:, :, ::1] of = np.array(values, dtype=float, order="C")
        cdef Py_ssize_t[::1] i = np.array([*rows, 0], dtype=np.intp), j = np.array([*columns, 0], dtype=np.intp)
        cdef Py_ssize_t entries = len(rows), joints = self.whole - self.packed.of.counts.inner
        cdef beam_tangents *x = &self.tangents
        cdef Memory memory
        if self.of.api.real_bytes != sizeof(double) or self.thesis:
            raise ValueError("expected equations of the exact form in double precision")
        _within("rows and columns", [rows, columns], 0, self.whole)
        shape = len(values), len(times), 3 * entries + self.whole + 3 * self.m * joints
        if not (len(times) == len(weights) > 0 and len(columns) == entries and len(values)) or np.shape(values) != shape:
            raise ValueError(f"expected values of shape {shape}, got {np.shape(values)}")
        x.parameters, x.points, x.entries, x.rows, x.columns = len(values), len(times), entries, &i[0], &j[0]
        x.times, x.weights, x.values = &at[0], &by[0], &of[0, 0, 0]
        memory = memory_of(0, self.api.beams_carry(self.assembly, x, NULL))
        self.api.beams_carry(self.assembly, x, memory.at)
        self.kept = at, by, of, i, j, memory

    cdef object _array(self, const void *raw, shape):
        return _doubles(self.of, raw, shape)

    def matrices(self, double t, int analysis=_IN_MOTION) -> tuple[int, Array, Array, Array, Array, Array | None]:
        """Return status, mass, damping, stiffness (dense) and load of the free unknowns, and R, R', R'' or None.

        Analysis ``AT_REST``: the structure in its pose, without loads of the motion. ``QUASI_STATIC``: with loads and
        axial forces of the rigid motion, without inertia and damping of the elastic motion.
        """
        cdef const beams *seen = self.assembly
        status, rows, columns, entries = self.sparse(t, analysis)
        made = []
        for values in entries:
            matrix = np.zeros((seen.free, seen.free))
            matrix[rows, columns] = values
            made.append(matrix)
        forces = self._array(seen.forces, (seen.modes, 2, seen.free))
        made[1] += forces[:, 0].T @ forces[:, 0]
        made[2] += forces[:, 0].T @ forces[:, 1]
        basis = None
        if self.m:
            basis = np.zeros((3, seen.whole, seen.free))
            basis[0, :seen.inner, :seen.inner] = np.eye(seen.inner)
            basis[:, seen.inner:, seen.inner:] = self._array(
                seen.basis, (3, seen.whole - seen.inner, seen.free - seen.inner)
            )
        return status, *made, self._array(seen.load, seen.free), basis

    def sparse(self, double t, int analysis=_IN_MOTION) -> tuple[int, Indices, Indices, list[Array]]:
        """Return status, rows, columns, and the entries of mass, damping and stiffness at these places.

        The last two are without the damping of modes if it is stored separately: see ``coupled`` of the layout.
        """
        cdef const beams *seen = self.assembly
        cdef int status = self.api.beams_assemble(self.assembly, t, analysis)
        made = [self._array(seen.mass, seen.entries), self._array(seen.damping, seen.entries),
                self._array(seen.stiffness, seen.entries)]
        return status, _indices(seen.rows, seen.entries), _indices(seen.columns, seen.entries), made

    def full_stiffness(self) -> tuple[Indices, Indices, Array]:
        """Return rows, columns and entries of the stiffness of all unknowns, constrained or not, at the present
        time."""
        cdef const beams *seen = self.assembly
        cdef Py_ssize_t count = seen.layout.counts.entries
        return _indices(seen.layout.rows, count), _indices(seen.layout.columns, count), self._array(seen.full_stiffness, count)

    def unbalanced(self, s: ArrayLike, int analysis=_QUASI_STATIC) -> Array:
        """Return K S - Q of all unknowns, (n,), at the time of the last matrices, for an ``analysis``.

        It is summed link by link: the larger axial entries take no digits from bending.
        """
        cdef Reals given = Reals(self.of, s), found = Reals(self.of, np.zeros(self.whole))
        at_least("unknowns", given.count, self.whole)
        self.api.beams_unbalanced(self.assembly, analysis, given.at, found.at)
        found.back()
        return found.doubles

    def residual(self, times: ArrayLike, s: ArrayLike, v: ArrayLike, a: ArrayLike,
                 int analysis=_IN_MOTION) -> tuple[int, Array, Array]:
        """Return a status, M S'' + C S' + K S - Q of all unknowns, and the rows of their constraints.

        At rising times, (times, n) and (times, m, n), for S, S' and S'', (times, n) each. See :meth:`matrices` for
        ``analysis``.
        """
        cdef const beams *seen = self.assembly
        cdef const double[::1] when = np.ascontiguousarray(times, dtype=float)
        cdef Py_ssize_t k, i, e, mode, count = when.shape[0], n = self.whole, entries = seen.layout.counts.entries
        given = np.ascontiguousarray([a, v, s], dtype=float).reshape(3, count, n)
        found, rows = np.zeros((count, n)), np.zeros((count, self.m, n))
        cdef const double[:, :, ::1] by = given
        cdef double[:, ::1] out = found
        cdef double[::1] values, bound, forces, summed = np.empty(n)
        cdef double rate
        cdef int status = _DONE
        for k in range(count):
            status = self.api.beams_assemble(self.assembly, when[k], analysis)
            if status != _DONE:
                break
            if k == 0:
                values, bound = np.empty(entries + n + 1), np.empty(self.m * (n - seen.inner) + 1)
                forces = np.empty(2 * seen.modes * n + 1)
            self.of.api.narrow(n, seen.full_load, &values[0], NULL)
            for i in range(n):
                out[k, i] = -values[i]
            for i, raw in enumerate((<size_t>seen.full_mass, <size_t>seen.full_damping, <size_t>seen.full_stiffness)):
                self.of.api.narrow(entries, <const void *><size_t>raw, &values[0], NULL)
                summed[:] = 0.0
                for e in range(entries):
                    summed[seen.layout.rows[e]] += values[e] * by[i, k, seen.layout.columns[e]]
                for e in range(n):
                    out[k, e] += summed[e]
            self.of.api.narrow(2 * seen.modes * n, seen.full_forces, &forces[0], NULL)
            for mode in range(seen.modes):
                rate = 0.0
                for i in range(n):
                    rate += forces[2 * mode * n + i] * by[1, k, i] + forces[(2 * mode + 1) * n + i] * by[2, k, i]
                for i in range(n):
                    out[k, i] += forces[2 * mode * n + i] * rate
            if self.m:
                self.of.api.narrow(self.m * (n - seen.inner), seen.bound, &bound[0], NULL)
                rows[k, :, seen.inner:] = np.asarray(bound)[:self.m * (n - seen.inner)].reshape(self.m, n - seen.inner)
        return status, found, rows


cdef class BeamBatch(Integrable):
    """The equations of a batch of states that move together: S of all columns, then S', in rows of ``columns``.

    The load acts on the first column only. Columns after it carry its tangents: see :meth:`BeamEquations.carry`.
    """

    cdef readonly BeamEquations single

    def __init__(self, BeamEquations equations, Py_ssize_t columns):
        cdef equation_sizes wanted = equations.core.sizes
        cdef kernels none
        if columns < 1 or 1 < columns <= equations.tangents.parameters:
            raise ValueError(f"expected a column of states, and one for each tangent, got {columns}")
        memset(&none, 0, sizeof(none))
        wanted.n *= columns
        wanted.work *= columns
        self.single, self.of = equations, equations.of
        self.make(&wanted, &none)
        self.core.of, self.core.owner = equations.core.of, equations.core.owner
        self.core.account = equations.core.account
        self.bound(np.zeros(1))

    def save(self) -> bytes:
        """Return the bytes of its memory, and of that of the equations."""
        return self.memory.saved() + self.single.save()

    def restore(self, const unsigned char[::1] memory) -> None:
        """Restore the bytes of :meth:`save` for the same equations."""
        self.memory.restore(memory)
        self.single.restore(memory[self.memory.bytes:])
