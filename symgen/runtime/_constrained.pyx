# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The binding of mechanical systems of parts in the core: see ``core/system.h``."""

from typing import TYPE_CHECKING

import numpy as np

from libc.math cimport NAN
from libc.stdint cimport uintptr_t
from libc.string cimport memcpy, memset

from symgen.calls import FAILURES, raise_failure
from symgen.runtime._core cimport Core, Integrable, at_least, equations, kernel_of, kernel_t, kernels, sizes
from symgen.runtime._headers cimport (
    _WIDEST_ROW, envelope, states, slopes as slopes_at, part, elements, rows, ties, rigid, added, system,
    system_motion, system_api,
)
from symgen.runtime._core import DOUBLE

if TYPE_CHECKING:
    from symgen.runtime.elastic.large.collocation import EnvelopePattern
    from symgen.runtime.kernels.evaluate import Evaluator

cdef const system_api *API = (<Core>DOUBLE).api.system


cdef int _within(str what, values, Py_ssize_t low, Py_ssize_t high) except -1:
    """Raise ValueError where an index is below ``low`` or not below ``high``."""
    found = np.asarray(values)
    if (found < low).any() or (found >= high).any():
        raise ValueError(f"expected {what} from {low} to below {high}, got {found.tolist()}")
    return 0


cdef Py_ssize_t[::1] _places(values):
    # One spare number, so that the first has an address.
    return np.append(np.ravel(values), 0).astype(np.intp)


cdef double[::1] _numbers(values):
    return np.append(np.ravel(values), 0.0).astype(float)


cdef class Part:
    """A part of a system: ``pairs`` (2, entries) of unknowns with slopes; ``bound`` (2, entries), row and unknown of
    the entries of constraints."""

    cdef readonly object pairs, bound  # type: Indices
    cdef part *of
    cdef Py_ssize_t[::1] slots, below, right

    def take(self, pattern: EnvelopePattern, Py_ssize_t unknowns) -> None:
        """Set the slots of the entries in a pattern; -1 for slopes by prescribed numbers."""
        row, place = self.bound
        below, right = pattern.slots(unknowns + row, place), pattern.slots(place, unknowns + row)
        known = place >= unknowns
        self.slots = _places(pattern.slots(*self.pairs))
        self.below, self.right = (_places(np.where(known, -1, of)) for of in (below, right))
        self.of.slots, self.of.below, self.of.right = &self.slots[0], &self.below[0], &self.right[0]


cdef class Elements(Part):
    """Elements of a link: kernels by name, unknowns (elements, size), properties (elements, numbers) or (1, numbers)."""

    cdef elements own
    cdef object kernels
    cdef Py_ssize_t[::1] places
    cdef double[::1] properties, state, out

    def __init__(self, kernels: Mapping[str, int], places: Indices, properties: Array, bint damped):
        cdef elements *own = &self.own
        self.kernels, self.of = kernels, &own.part
        own.count, own.size = places.shape
        own.stride = properties.shape[1] if len(properties) > 1 else 0
        at_least("rows of properties", len(properties), own.count if own.stride else 1)
        self.places, self.properties = _places(places), _numbers(properties)
        self.state, self.out = np.zeros(3 * own.size), np.zeros(3 * own.size ** 2)
        own.residual, own.tangent, own.energies = (
            <kernel_t><uintptr_t>kernels["residual"], <kernel_t><uintptr_t>kernels["tangent"], <kernel_t><uintptr_t>kernels["energies"])
        own.places, own.properties, own.state, own.out = &self.places[0], &self.properties[0], &self.state[0], &self.out[0]
        pairs = np.broadcast_arrays(places[:, :, None], places[:, None, :])
        self.pairs, self.bound = np.stack(pairs).reshape(2, -1), np.zeros((2, 0), dtype=np.intp)
        API.bind_elements(own, damped)

    def values(self, str kernel, Py_ssize_t width, q: Array, v: Array, a: Array) -> Array:
        """Return the results of a kernel for every element at states (times, unknowns): (times, elements, width)."""
        cdef double[:, ::1] states = np.empty((3, self.own.size))
        cdef double[:, :, ::1] found = np.empty((len(q), self.own.count, width))
        cdef const double[:, :] places = q, rates = v, second = a
        cdef kernel_t function = <kernel_t><uintptr_t>self.kernels[kernel]
        cdef Py_ssize_t row, element, k, place
        cdef double none = 0.0
        for what in (v, a):
            at_least("rows of states", len(what), len(q))
        for row in range(found.shape[0]):
            for element in range(self.own.count):
                for k in range(self.own.size):
                    place = self.places[element * self.own.size + k]
                    at_least("unknowns in states", min(places.shape[1], rates.shape[1], second.shape[1]), place + 1)
                    states[0, k], states[1, k], states[2, k] = places[row, place], rates[row, place], second[row, place]
                function(&none, &states[0, 0], &states[1, 0], &self.properties[element * self.own.stride], NULL, &found[row, element, 0])
        return found.base


cdef class Rows(Part):
    """Constraints by a kernel each, which writes the error, its rate, and the slopes by the places of the row.

    Parameters
    ----------
    kernel
        Its address.
    places, slopes
        Unknowns of the states, (rows, size), and those of the slopes: a prescribed number where one vanishes.
    first
        Number of the first row.
    factors, properties, acting
        Numbers behind the rates, parameters and work of the kernel, (rows, numbers) each.
    inner
        Entries of second slopes (rows, size, size) by increasing number.
    curvature
        Their values; None where the kernel writes second slopes behind the slopes.
    """

    cdef rows own
    cdef readonly object read
    cdef Py_ssize_t[::1] places, inner
    cdef double[::1] factors, properties, acting, curvature, out

    def __init__(self, uintptr_t kernel, places: Indices, slopes: Indices, Py_ssize_t first, factors: Array,
                 properties: Array, acting: Array, inner: Indices, curvature: Array | None):
        cdef rows *own = &self.own
        self.of, own.row, own.first = &own.part, <kernel_t>kernel, first
        own.count, own.size = places.shape
        own.factors_of, own.properties_of, own.acting_of = factors.shape[1], properties.shape[1], acting.shape[1]
        if max(own.size, own.factors_of, own.acting_of) > _WIDEST_ROW:
            raise ValueError(f"expected at most {_WIDEST_ROW} numbers of a row, got {own.size}, {own.factors_of}, {own.acting_of}")
        for of in (slopes, factors, properties, acting):
            at_least("rows", len(of), own.count)
        self.read, self.places, self.inner = places, _places(places), _places(inner)
        self.factors, self.properties, self.acting = _numbers(factors), _numbers(properties), _numbers(acting)
        own.inner_count, own.inner, own.curvature = len(inner), &self.inner[0], NULL
        if curvature is not None:
            at_least("second slopes", len(curvature), len(inner))
            self.curvature = _numbers(curvature)
            own.curvature = &self.curvature[0]
        self.out = np.zeros(2 + own.size + own.size ** 2)
        own.places, own.factors, own.properties = &self.places[0], &self.factors[0], &self.properties[0]
        own.acting, own.out = &self.acting[0], &self.out[0]
        self.bound = np.array([np.repeat(first + np.arange(own.count), own.size), slopes.ravel()])
        row, i, j = np.unravel_index(inner, (own.count, own.size, own.size))
        self.pairs = np.stack([places[row, i], places[row, j]])
        API.bind_rows(own)


cdef class Ties(Part):
    """Linear constraints: entries with row, place and factor."""

    cdef ties own
    cdef Py_ssize_t[::1] rows, places
    cdef double[::1] factors

    def __init__(self, rows: ArrayLike, places: ArrayLike, factors: ArrayLike):
        self.rows, self.places, self.factors = _places(rows), _places(places), _numbers(factors)
        self.own.count, self.own.rows, self.own.places = len(rows), &self.rows[0], &self.places[0]
        self.of, self.own.factors = &self.own.part, &self.factors[0]
        self.pairs, self.bound = np.zeros((2, 0), dtype=np.intp), np.array([rows, places], dtype=np.intp)
        API.bind_ties(&self.own)


cdef class Rigid(Part):
    """Rigid links, particles and loads, over the first unknowns; their constraints are the first rows.

    Parameters
    ----------
    rigid, joints
        The :class:`symgen.runtime.kernels.evaluate.Evaluator` of the linkage and of its ``elastic_joints``.
    rows, in_jacobian, sizes
        Numbers of the constraints in the linkage and in the Jacobian of ``joints``, and their scales.
    entries
        Unknowns (entries, 2) of the entries of mass, damping and stiffness from ``joints``.
    """

    cdef rigid own
    cdef object owners
    cdef Py_ssize_t[::1] in_jacobian, of_rows
    cdef double[::1] p_joints, p, sizes, work, spare, out

    def __init__(self, rigid: Evaluator, joints: Evaluator, rows: Sequence[int], in_jacobian: Sequence[int],
                 sizes: ArrayLike, entries: Sequence[Indices | Sequence[tuple[int, ...]]]):
        cdef uintptr_t address
        names = ("mass_matrix", "damping", "stiffness")
        info, self.owners, self.of = joints.info("joints"), [rigid, joints], &self.own.part
        blocks = {block.name: block for block in info.blocks}
        self.own.n, self.own.count = rigid.description.coordinates, len(rows)
        address = joints.library.addresses["joints"]
        self.own.joints = <kernel_t>address
        widest, work = info.out_size, info.work_size
        if self.own.count:
            for name in ("velocity_constraints", "constraints"):
                other = rigid.info(name)
                widest, work = max(widest, other.out_size), max(work, other.work_size)
            address = rigid.library.addresses["velocity_constraints"]
            self.own.rates = <kernel_t>address
            address = rigid.library.addresses["constraints"]
            self.own.constraints = <kernel_t>address
            self.own.jacobian, self.own.columns = blocks["jacobian"].offset, blocks["jacobian"].shape[1]
        self.own.load = blocks["load"].offset
        other = joints.info("energy")
        powers = [block.offset for block in other.blocks if block.name == "power"]
        if powers:
            (self.own.power,) = powers
            widest, work = max(widest, other.out_size), max(work, other.work_size)
            address = joints.library.addresses["energy"]
            self.own.energy = <kernel_t>address
        self.p, self.sizes = _numbers(rigid.parameters), _numbers(sizes)
        self.of_rows, self.in_jacobian = _places(rows), _places(in_jacobian)
        self.work = np.zeros(max(work, self.own.n + len(rigid.description.constraints)) + 1)
        self.spare, self.out = np.zeros(work + 1), np.zeros(widest + 1)
        self.own.p, self.own.sizes, self.own.of_rows, self.own.in_jacobian = &self.p[0], &self.sizes[0], &self.of_rows[0], &self.in_jacobian[0]
        self.own.work, self.own.spare, self.own.out = &self.work[0], &self.spare[0], &self.out[0]
        for k, name in enumerate(names):
            self.own.entries[k], self.own.at[k] = len(entries[k]), blocks[name].offset if len(entries[k]) else 0
        self.pairs = np.concatenate([np.reshape(of, (-1, 2)) for of in entries]).T.astype(np.intp)
        self.bound = np.indices((self.own.count, self.own.n)).reshape(2, -1)
        self.take_parameters(joints.parameters)
        API.bind_rigid(&self.own)

    def take_parameters(self, joints: ArrayLike) -> None:
        """Take other parameters of ``elastic_joints``."""
        if self.p_joints is not None:
            at_least("parameters", len(joints), len(self.p_joints) - 1)
        self.p_joints = _numbers(joints)
        self.own.p_joints = &self.p_joints[0]


cdef class Added(Part):
    """Forces and slopes from Python functions: ``forces(t, q, v, a)``, (times, unknowns), ``slopes(t, q, v)``.

    Slopes (3, number of ``places``): derivatives of the force on each unknown in ``places`` by this unknown.
    ``power()``: power of loads among these forces [W] at the last states of ``forces``, (times,).
    """

    cdef added own
    cdef object forces_of, slopes_of, power_of
    cdef double[::1] found

    def __init__(self, forces: Callable[[Array, Array, Array, Array], Array],
                 slopes: Callable[[Array, Array, Array], Array], places: Indices, power: Callable[[], Array]):
        self.forces_of, self.slopes_of, self.power_of = forces, slopes, power
        self.pairs, self.bound = np.array([places, places], dtype=np.intp), np.zeros((2, 0), dtype=np.intp)
        self.own.entries, self.found = len(places), np.zeros(3 * len(places) + 1)
        self.of, self.own.owner, self.own.found = &self.own.part, <void *>self, &self.found[0]
        self.own.forces, self.own.slopes, self.own.power = _forces, _slopes, _power
        API.bind_added(&self.own)


cdef void _forces(void *owner, const states *s, double *forces) noexcept with gil:
    cdef Added of = <Added>owner
    cdef double[:, ::1] found
    cdef Py_ssize_t k
    try:
        t = _copied(<uintptr_t>s.t, 1, s.count)[0]
        found = np.ascontiguousarray(of.forces_of(t, *(_copied(x, s.count, s.unknowns) for x in (<uintptr_t>s.q, <uintptr_t>s.v, <uintptr_t>s.a))))
        for k in range(s.count * s.unknowns):
            forces[k] += (&found[0, 0])[k]
    except BaseException as error:
        FAILURES.errors.append(error)
        forces[0] = NAN


cdef void _slopes(void *owner, const states *s, double *into) noexcept with gil:
    cdef Added of = <Added>owner
    cdef double[:, ::1] found
    try:
        if of.own.entries:
            t = _copied(<uintptr_t>s.t, 1, 1)[0]
            found = np.ascontiguousarray(of.slopes_of(t, *(_copied(x, 1, s.unknowns) for x in (<uintptr_t>s.q, <uintptr_t>s.v))))
            memcpy(into, &found[0, 0], 3 * of.own.entries * sizeof(double))
    except BaseException as error:
        FAILURES.errors.append(error)
        into[0] = NAN


cdef double _power(void *owner, Py_ssize_t row) noexcept with gil:
    cdef Added of = <Added>owner
    try:
        return of.power_of()[row]
    except BaseException as error:
        FAILURES.errors.append(error)
        return NAN


cdef object _copied(uintptr_t raw, Py_ssize_t rows, Py_ssize_t columns):
    cdef double[:, ::1] made = np.empty((rows, columns))
    memcpy(&made[0, 0], <const double *>raw, rows * columns * sizeof(double))
    return made.base


cdef class Constrained:
    """A system of parts over unknowns, multipliers and prescribed numbers.

    Parameters
    ----------
    pattern
        A :class:`symgen.runtime.elastic.large.collocation.EnvelopePattern` of the entries of all parts.
    """

    cdef tuple parts
    cdef system own
    cdef states at
    cdef readonly object pattern  # type: EnvelopePattern
    cdef Py_ssize_t[::1] first, starts, position
    cdef uintptr_t[::1] heads
    cdef double[:, ::1] values, sides

    def __init__(self, Py_ssize_t unknowns, Py_ssize_t multipliers, Py_ssize_t known, pattern: EnvelopePattern,
                 parts: Sequence[Part]):
        cdef Part each
        cdef system *own = &self.own
        self.pattern, self.parts = pattern, tuple(parts)
        own.unknowns, own.multipliers, own.known, own.count = unknowns, multipliers, known, len(self.parts)
        self.first, self.starts, self.position = _places(pattern.first), _places(pattern.starts), _places(pattern.position)
        own.envelope.n, own.envelope.first, own.envelope.at = unknowns + multipliers, &self.first[0], &self.starts[0]
        self.heads = np.zeros(own.count + 1, dtype=np.uintp)
        for k, each in enumerate(self.parts):
            _within("unknowns", each.pairs, 0, unknowns)
            _within("rows of constraints", each.bound[0], 0, multipliers)
            _within("places of constraints", each.bound[1], 0, unknowns + known)
            if isinstance(each, Rows):
                _within("places of states", each.read, 0, unknowns + known)
            each.take(pattern, unknowns)
            self.heads[k] = <uintptr_t>each.of
        self.values, self.sides = np.zeros((4, pattern.size)), np.zeros((2, unknowns + multipliers + 1))
        own.parts, own.position, own.slopes.size = <const part **>&self.heads[0], &self.position[0], pattern.size
        own.slopes.by_a, own.slopes.by_v, own.slopes.by_q, own.slopes.jacobian = (
            &self.values[0, 0], &self.values[1, 0], &self.values[2, 0], &self.values[3, 0])
        own.x, own.y = &self.sides[0, 0], &self.sides[1, 0]

    def _take(self, t, q, v, a, multipliers, known, known_rates):
        """Point to states at ``count`` times; return arrays that must stay alive."""
        cdef Py_ssize_t count = len(t), n = self.own.unknowns, m = self.own.multipliers, k = self.own.known
        kept = [np.ascontiguousarray(t, dtype=float)]
        for values, width in zip((q, v, a, multipliers, known, known_rates), (n, n, n, m, k, k)):
            # An empty array has no address.
            row = np.zeros((count, 1)) if width == 0 else np.ascontiguousarray(values, dtype=float)
            if row.shape != (count, max(width, 1)):
                raise ValueError(f"expected {count} rows of {width} numbers, got {row.shape}")
            kept.append(row)
        self.point(count, kept)
        return kept

    cdef int point(self, Py_ssize_t count, list of) except -1:
        cdef const double[::1] t = of[0]
        cdef const double[:, ::1] q = of[1], v = of[2], a = of[3], m = of[4], known = of[5], moving = of[6]
        self.at = states(
            count, self.own.unknowns, self.own.multipliers, self.own.known, &t[0], &q[0, 0], &v[0, 0], &a[0, 0],
            &m[0, 0], &known[0, 0], &moving[0, 0])
        return 0

    def forces(self, *state: Array) -> Array:
        """Return M a + ... + J^T lambda, (times, unknowns), of states: t, q, v, a, multipliers, known, known_rates."""
        kept = self._take(*state)
        cdef double[:, ::1] found = np.zeros((self.at.count, self.own.unknowns))
        API.evaluate(&self.own, &self.at, &found[0, 0], NULL, NULL)
        raise_failure()
        return found.base

    def rows(self, t: Array, q: Array, v: Array, known: Array, known_rates: Array) -> tuple[Array, Array]:
        """Return the constraints Phi and their rates J v + Phi_t, (times, multipliers) each."""
        cdef double[:, :, ::1] found = np.zeros((2, len(t), max(self.own.multipliers, 1)))
        kept = self._take(t, q, v, q, np.zeros((len(t), self.own.multipliers)), known, known_rates)
        API.evaluate(&self.own, &self.at, NULL, &found[0, 0, 0], &found[1, 0, 0])
        raise_failure()
        return found.base[:, :, :self.own.multipliers]

    def slopes(self, *state: Array) -> tuple[Array, Array, Array, Array]:
        """Return slopes by second rates, rates and places, and slopes of constraints, (4, slots), at one state."""
        kept = self._take(*state)
        API.refresh(&self.own, &self.at)
        raise_failure()
        return self.values.base.copy()

    def accelerated(self, right: Array, *state: Array) -> Array:
        """Return second rates and multipliers for a right-hand side of M a + J^T lambda, J a, at one state."""
        cdef double[::1] x = np.array(right, dtype=float), factors = np.empty(self.own.slopes.size)
        kept = self._take(*state)
        at_least("numbers of a right-hand side", len(x), self.own.unknowns + self.own.multipliers)
        API.refresh(&self.own, &self.at)
        raise_failure()
        return x.base if API.accelerate(&self.own, &factors[0], &x[0]) else np.full(len(x), np.nan)


cdef class SystemMotion(Integrable):
    """A system as equations of a run by collocation: y = (q, v, work); see ``struct system_motion`` in ``core/system.h``.

    Parameters
    ----------
    scale
        Sizes of the unknowns, (unknowns,).
    stages
        Number of stages of the method.
    prescribed
        Function of number, time and length of a step that returns the first one of some steps around it, and their
        prescribed numbers and rates, (steps, 2 + stages, numbers) each: in the middle of a step, at its stages and end.
    follow
        Function of time, places and rates before each step; None if nothing takes note of them.
    a, multipliers
        Second rates and multipliers at the start.
    rigid
        The :class:`symgen.runtime.kernels.evaluate.Evaluator` of a linkage whose coordinates are the first unknowns, and
        whose events are located; None without events.
    """

    cdef Constrained system
    cdef system_motion own
    cdef object prescribed, followed
    cdef Py_ssize_t stages
    cdef double[::1] scale, a, multipliers, z, z_rates, gaps

    def __init__(self, Constrained system, scale: Array, Py_ssize_t stages,
                 prescribed: Callable[[int, float, float], tuple[int, Array, Array]],
                 follow: Callable[[float, Array, Array], None] | None, a: Array, multipliers: Array,
                 rigid: Evaluator | None):
        cdef kernels functions
        cdef sizes wanted
        cdef system_motion *own = &self.own
        cdef double[::1] parameters = _numbers(())
        self.of, self.system, self.stages, self.prescribed, self.followed = DOUBLE, system, stages, prescribed, follow
        memset(&functions, 0, sizeof(kernels))
        memset(&wanted, 0, sizeof(sizes))
        wanted.n, wanted.extra = system.own.unknowns, 1
        if rigid is not None:
            self.libraries, info, parameters = rigid.library, rigid.info("events"), _numbers(rigid.parameter_values)
            functions.events = kernel_of(rigid.library.addresses, "events")
            functions.setup = kernel_of(rigid.library.addresses, "setup")
            wanted.parameters, wanted.derived, wanted.work = len(parameters) - 1, rigid.library.derived, info.work_size
            wanted.events = len(rigid.description.events)
        self.make(&wanted, &functions)
        self.bound(parameters)
        API.bind_motion(self.core, own)
        if rigid is not None:
            # The kernel writes more than the values of events.
            self.gaps = np.zeros(info.out_size)
            self.core.gaps = &self.gaps[0]
        self.scale, self.a, self.multipliers = _numbers(scale), _numbers(a), _numbers(multipliers)
        at_least("sizes of unknowns", len(self.scale) - 1, self.n)
        at_least("second rates", len(self.a) - 1, stages * self.n)
        at_least("multipliers", len(self.multipliers) - 1, stages * system.own.multipliers)
        own.of, own.scale, own.a, own.lambda_ = &system.own, &self.scale[0], &self.a[0], &self.multipliers[0]
        own.prescribe, own.each, own.owner = _prescribe, follow is not None, <void *>self

    @property
    def of_stages(self) -> tuple[Array, Array]:
        """Second rates and multipliers of the stages of the last step of the last run, (stages, numbers) each."""
        return tuple(
            _copied(at, self.stages, width)
            for at, width in (
                (<uintptr_t>self.own.a_of, self.n), (<uintptr_t>self.own.lambda_of, self.system.own.multipliers)))

    def restore(self, const unsigned char[::1] memory) -> None:
        """Restore the bytes of :meth:`save`; steps from there may have other lengths."""
        Integrable.restore(self, memory)
        self.own.count = 0

    cdef int prescribe(self, long step, double t, double h, const double *y) except -1:
        cdef Py_ssize_t width = (self.stages + 2) * self.system.own.known
        if self.followed is not None:
            self.followed(t, *_copied(<uintptr_t>y, 2, self.n))
        if not self.own.first <= step < self.own.first + self.own.count:
            first, z, rates = self.prescribed(step, t, h)
            at_least("prescribed numbers", min(np.size(z), np.size(rates)), len(z) * width)
            self.z, self.z_rates = _numbers(z), _numbers(rates)
            self.own.first, self.own.count, self.own.z, self.own.z_rates = first, len(z), &self.z[0], &self.z_rates[0]
        return 0


cdef void _prescribe(void *owner, long step, double t, double h, const double *y) noexcept with gil:
    cdef SystemMotion of = <SystemMotion>owner
    try:
        of.prescribe(step, t, h, y)
    except BaseException as error:
        FAILURES.errors.append(error)
        of.own.count = 0
