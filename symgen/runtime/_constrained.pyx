# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Mechanical systems of elements with constraints, M a + ... + J^T lambda = 0, Phi = 0, and their steps.

The parts of a system add their forces, constraints and slopes. Vectors in constraints may be unknowns, or prescribed
numbers behind these, such as positions of the ground.
"""

import numpy as np

from libc.math cimport fabs, isfinite
from libc.stdint cimport uintptr_t
from libc.string cimport memcpy

from symgen.calls import raise_failure
from symgen.runtime._core cimport Core, at_least, kernel_t
from symgen.runtime._core import DOUBLE

cdef extern from "core/elastic.h" nogil:
    cdef struct envelope:
        Py_ssize_t n
        const Py_ssize_t *first
        const Py_ssize_t *at

    cdef struct elastic_table "elastic_api":
        int (*envelope_factor)(const envelope *, void *, void *) noexcept nogil
        void (*envelope_solve)(const envelope *, const void *, const void *, void *, void *) noexcept nogil

cdef const elastic_table *API = <const elastic_table *>(<Core>DOUBLE).api.elastic

cdef enum:
    # The most places, factors or numbers of work of a constraint.
    _WIDEST = 21

#: Corrections that do not decrease are rounding below this part of the size of the unknowns.
cdef double _ROUNDING = 1e-10
#: Largest number of corrections in a step; largest ratio of a correction to the previous two, above which they
#: diverge.
cdef int _MOST = 30
cdef double _DIVERGING = 2.0
#: Rounding of places over their sizes; rates have as much over a step.
cdef double _SPACING = 16 * 2.2e-16

cdef struct states:
    # Rows of times, places, rates, second rates, multipliers, and of prescribed numbers with their rates.
    Py_ssize_t count, unknowns, multipliers, known
    const double *t
    const double *q
    const double *v
    const double *a
    const double *multipliers_of
    const double *known_of
    const double *known_rates

cdef struct matrices:
    # Rows of slots: slopes by second rates, rates and places, and slopes of the constraints.
    Py_ssize_t size
    double *of


cdef inline double _of(const double *own, Py_ssize_t unknowns, const double *known, Py_ssize_t place) noexcept nogil:
    return own[place] if place < unknowns else known[place - unknowns]


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

    cdef readonly object pairs, bound
    cdef Py_ssize_t[::1] slots, below, right
    #: Whether it has an input power.
    cdef bint loaded

    def take(self, pattern, Py_ssize_t unknowns):
        """Set the slots of the entries in a pattern; -1 for slopes by prescribed numbers."""
        row, place = self.bound
        below, right = pattern.slots(unknowns + row, place), pattern.slots(place, unknowns + row)
        known = place >= unknowns
        self.slots = _places(pattern.slots(*self.pairs))
        self.below, self.right = (_places(np.where(known, -1, of)) for of in (below, right))

    cdef int evaluate(self, const states *s, double *forces, double *errors, double *rates) except -1:
        """Add forces, errors of constraints and their rates at all states; each may be NULL."""
        return 0

    cdef int add_slopes(self, const states *s, matrices *to) except -1:
        """Add slopes at the first state."""
        return 0

    cdef double dissipation(self, const states *s, Py_ssize_t row):
        """Return the power dissipated by damping at a state [W]."""
        return 0.0

    cdef double input(self, const states *s, Py_ssize_t row):
        """Return the power of loads without potential, and of inertia and loads at moving ground, at a state [W]."""
        return 0.0

    cdef inline void bind(self, matrices *to, Py_ssize_t entry, double slope) noexcept:
        if self.below[entry] >= 0:
            to.of[3 * to.size + self.below[entry]] += slope
            to.of[3 * to.size + self.right[entry]] += slope


cdef class Elements(Part):
    """Elements of a link: kernels by name, unknowns (elements, size), properties (elements, numbers) or (1, numbers)."""

    cdef object kernels
    cdef kernel_t residual, tangent, energies
    cdef Py_ssize_t count, size, apart
    cdef Py_ssize_t[::1] places
    cdef double[::1] properties, state, out
    cdef bint damped

    def __init__(self, kernels, places, properties, bint damped):
        self.kernels = kernels
        self.residual = <kernel_t><uintptr_t>kernels["residual"]
        self.tangent = <kernel_t><uintptr_t>kernels["tangent"]
        self.energies = <kernel_t><uintptr_t>kernels["energies"]
        self.count, self.size = places.shape
        self.damped, self.apart = damped, properties.shape[1] if len(properties) > 1 else 0
        at_least("rows of properties", len(properties), self.count if self.apart else 1)
        self.places, self.properties = _places(places), _numbers(properties)
        self.state, self.out = np.zeros(3 * self.size), np.zeros(3 * self.size ** 2)
        pairs = np.broadcast_arrays(places[:, :, None], places[:, None, :])
        self.pairs, self.bound = np.stack(pairs).reshape(2, -1), np.zeros((2, 0), dtype=np.intp)

    def values(self, str kernel, Py_ssize_t width, q, v, a):
        """Return the results of a kernel for every element at states (times, unknowns): (times, elements, width)."""
        cdef double[:, ::1] states = np.empty((3, self.size))
        cdef double[:, :, ::1] found = np.empty((len(q), self.count, width))
        cdef const double[:, :] places = q, rates = v, second = a
        cdef kernel_t function = <kernel_t><uintptr_t>self.kernels[kernel]
        cdef Py_ssize_t row, element, k, place
        cdef double none = 0.0
        for what in (v, a):
            at_least("rows of states", len(what), len(q))
        for row in range(found.shape[0]):
            for element in range(self.count):
                for k in range(self.size):
                    place = self.places[element * self.size + k]
                    at_least("unknowns in states", min(places.shape[1], rates.shape[1], second.shape[1]), place + 1)
                    states[0, k], states[1, k], states[2, k] = places[row, place], rates[row, place], second[row, place]
                function(&none, &states[0, 0], &states[1, 0], &self.properties[element * self.apart], NULL, &found[row, element, 0])
        return found.base

    cdef inline void call(self, kernel_t kernel, const states *s, Py_ssize_t row, Py_ssize_t element) noexcept:
        cdef Py_ssize_t k, n = self.size, at = row * s.unknowns, place
        for k in range(n):
            place = at + self.places[element * n + k]
            self.state[k], self.state[n + k], self.state[2 * n + k] = s.q[place], s.v[place], s.a[place]
        kernel(s.t + row, &self.state[0], &self.state[n], &self.properties[element * self.apart], NULL, &self.out[0])

    cdef int evaluate(self, const states *s, double *forces, double *errors, double *rates) except -1:
        cdef Py_ssize_t row, element, k
        if forces == NULL:
            return 0
        for row in range(s.count):
            for element in range(self.count):
                self.call(self.residual, s, row, element)
                for k in range(self.size):
                    forces[row * s.unknowns + self.places[element * self.size + k]] += self.out[k]
        return 0

    cdef int add_slopes(self, const states *s, matrices *to) except -1:
        cdef Py_ssize_t element, k, i, entries = self.size * self.size
        for element in range(self.count):
            self.call(self.tangent, s, 0, element)
            for i in range(3):
                for k in range(entries):
                    to.of[i * to.size + self.slots[element * entries + k]] += self.out[i * entries + k]
        return 0

    cdef double dissipation(self, const states *s, Py_ssize_t row):
        cdef Py_ssize_t element
        cdef double power = 0.0
        if self.damped:
            for element in range(self.count):
                self.call(self.energies, s, row, element)
                power += self.out[3]
        return power


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

    cdef readonly object read
    cdef kernel_t row
    cdef Py_ssize_t count, size, first, behind, own, acts
    cdef Py_ssize_t[::1] places, inner
    cdef double[::1] factors, properties, acting, curvature, out

    def __init__(self, uintptr_t kernel, places, slopes, Py_ssize_t first, factors, properties, acting, inner, curvature):
        self.row, self.first = <kernel_t>kernel, first
        self.count, self.size = places.shape
        self.behind, self.own, self.acts = factors.shape[1], properties.shape[1], acting.shape[1]
        if max(self.size, self.behind, self.acts) > _WIDEST:
            raise ValueError(f"expected at most {_WIDEST} numbers of a row, got {self.size}, {self.behind}, {self.acts}")
        for of in (slopes, factors, properties, acting):
            at_least("rows", len(of), self.count)
        if curvature is not None:
            at_least("second slopes", len(curvature), len(inner))
        self.read = places
        self.places, self.factors, self.properties, self.acting = _places(places), _numbers(factors), _numbers(properties), _numbers(acting)
        self.inner, self.curvature = _places(inner), None if curvature is None else _numbers(curvature)
        self.out = np.zeros(2 + self.size + self.size ** 2)
        self.bound = np.array([np.repeat(first + np.arange(self.count), self.size), slopes.ravel()])
        row, i, j = np.unravel_index(inner, (self.count, self.size, self.size))
        self.pairs = np.stack([places[row, i], places[row, j]])

    cdef inline void call(self, const states *s, Py_ssize_t row, Py_ssize_t k) noexcept:
        cdef Py_ssize_t i, place, n = s.unknowns
        cdef double[3 * _WIDEST] state
        cdef double[_WIDEST] acting
        for i in range(self.size):
            place = self.places[k * self.size + i]
            state[i] = _of(s.q + row * n, n, s.known_of + row * s.known, place)
            state[self.size + i] = _of(s.v + row * n, n, s.known_rates + row * s.known, place)
        memcpy(state + 2 * self.size, &self.factors[k * self.behind], self.behind * sizeof(double))
        memcpy(acting, &self.acting[k * self.acts], self.acts * sizeof(double))
        self.row(s.t + row, state, state + self.size, &self.properties[k * self.own], acting, &self.out[0])

    cdef int evaluate(self, const states *s, double *forces, double *errors, double *rates) except -1:
        cdef Py_ssize_t row, k, i, place, at
        for row in range(s.count):
            for k in range(self.count):
                self.call(s, row, k)
                at = row * s.multipliers + self.first + k
                if errors != NULL:
                    errors[at] += self.out[0]
                if rates != NULL:
                    rates[at] += self.out[1]
                if forces == NULL:
                    continue
                for i in range(self.size):
                    place = self.places[k * self.size + i]
                    if place < s.unknowns:
                        forces[row * s.unknowns + place] += self.out[2 + i] * s.multipliers_of[at]
        return 0

    cdef int add_slopes(self, const states *s, matrices *to) except -1:
        cdef Py_ssize_t k, i, entry = 0, square = self.size * self.size
        cdef double second
        for k in range(self.count):
            self.call(s, 0, k)
            for i in range(self.size):
                self.bind(to, k * self.size + i, self.out[2 + i])
            while entry < self.inner.shape[0] - 1 and self.inner[entry] // square == k:
                second = self.curvature[entry] if self.curvature is not None else self.out[2 + self.size + self.inner[entry] % square]
                to.of[2 * to.size + self.slots[entry]] += second * s.multipliers_of[self.first + k]
                entry += 1
        return 0


cdef class Ties(Part):
    """Linear constraints: entries with row, place and factor."""

    cdef Py_ssize_t count
    cdef Py_ssize_t[::1] rows, places
    cdef double[::1] factors

    def __init__(self, rows, places, factors):
        self.count, self.rows, self.places, self.factors = len(rows), _places(rows), _places(places), _numbers(factors)
        self.pairs, self.bound = np.zeros((2, 0), dtype=np.intp), np.array([rows, places], dtype=np.intp)

    cdef int evaluate(self, const states *s, double *forces, double *errors, double *rates) except -1:
        cdef Py_ssize_t row, k, place, at, n = s.unknowns
        for row in range(s.count):
            for k in range(self.count):
                place, at = self.places[k], row * s.multipliers + self.rows[k]
                if forces != NULL and place < n:
                    forces[row * n + place] += self.factors[k] * s.multipliers_of[at]
                if errors != NULL:
                    errors[at] += self.factors[k] * _of(s.q + row * n, n, s.known_of + row * s.known, place)
                if rates != NULL:
                    rates[at] += self.factors[k] * _of(s.v + row * n, n, s.known_rates + row * s.known, place)
        return 0

    cdef int add_slopes(self, const states *s, matrices *to) except -1:
        cdef Py_ssize_t k
        for k in range(self.count):
            self.bind(to, k, self.factors[k])
        return 0


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

    cdef object owners
    cdef kernel_t joints, rates, constraints, energy
    cdef Py_ssize_t n, count, load, jacobian, columns, power
    cdef Py_ssize_t[::1] in_jacobian, of_rows
    cdef Py_ssize_t[3] at, entries
    cdef double[::1] p_joints, p, sizes, work, spare, out

    def __init__(self, rigid, joints, rows, in_jacobian, sizes, entries):
        names = ("mass_matrix", "damping", "stiffness")
        info, owners = joints.info("joints"), [rigid, joints]
        blocks = {block.name: block for block in info.blocks}
        self.owners, self.n, self.count = owners, rigid.description.coordinates, len(rows)
        self.joints = <kernel_t><uintptr_t>joints.library.addresses["joints"]
        widest, work = info.out_size, info.work_size
        if self.count:
            for name in ("velocity_constraints", "constraints"):
                other = rigid.info(name)
                widest, work = max(widest, other.out_size), max(work, other.work_size)
            self.rates = <kernel_t><uintptr_t>rigid.library.addresses["velocity_constraints"]
            self.constraints = <kernel_t><uintptr_t>rigid.library.addresses["constraints"]
            self.jacobian, self.columns = blocks["jacobian"].offset, blocks["jacobian"].shape[1]
        self.load, self.power = blocks["load"].offset, -1
        other = joints.info("energy")
        powers = [block.offset for block in other.blocks if block.name == "power"]
        if powers:
            (self.power,), self.loaded = powers, True
            widest, work = max(widest, other.out_size), max(work, other.work_size)
            self.energy = <kernel_t><uintptr_t>joints.library.addresses["energy"]
        self.p_joints, self.p = _numbers(joints.parameters), _numbers(rigid.parameters)
        self.of_rows, self.in_jacobian, self.sizes = _places(rows), _places(in_jacobian), _numbers(sizes)
        self.work = np.zeros(max(work, self.n + len(rigid.description.constraints)) + 1)
        self.spare, self.out = np.zeros(work + 1), np.zeros(widest + 1)
        for k, name in enumerate(names):
            self.entries[k], self.at[k] = len(entries[k]), blocks[name].offset if len(entries[k]) else 0
        self.pairs = np.concatenate([np.reshape(of, (-1, 2)) for of in entries]).T.astype(np.intp)
        self.bound = np.indices((self.count, self.n)).reshape(2, -1)

    def take_parameters(self, joints):
        """Take other parameters of ``elastic_joints``."""
        at_least("parameters", len(joints), len(self.p_joints) - 1)
        self.p_joints = _numbers(joints)

    cdef inline void call(self, const states *s, Py_ssize_t row) noexcept:
        cdef Py_ssize_t k
        cdef const double *q = s.q + row * s.unknowns
        memcpy(&self.work[0], s.a + row * s.unknowns, self.n * sizeof(double))
        for k in range(self.count):
            self.work[self.n + self.of_rows[k]] = s.multipliers_of[row * s.multipliers + k] / self.sizes[k]
        self.joints(s.t + row, q, s.v + row * s.unknowns, &self.p_joints[0], &self.work[0], &self.out[0])

    cdef inline void scaled(self, kernel_t kernel, const states *s, Py_ssize_t row, double *to) noexcept:
        cdef Py_ssize_t k, at = row * s.unknowns
        kernel(s.t + row, s.q + at, s.v + at, &self.p[0], &self.spare[0], &self.out[0])
        for k in range(self.count):
            to[row * s.multipliers + k] += self.out[self.of_rows[k]] / self.sizes[k]

    cdef double input(self, const states *s, Py_ssize_t row):
        if self.power < 0:
            return 0.0
        memcpy(&self.work[0], s.a + row * s.unknowns, self.n * sizeof(double))
        self.energy(s.t + row, s.q + row * s.unknowns, s.v + row * s.unknowns, &self.p_joints[0], &self.work[0], &self.out[0])
        return self.out[self.power]

    cdef int evaluate(self, const states *s, double *forces, double *errors, double *rates) except -1:
        cdef Py_ssize_t row, k, i, at
        for row in range(s.count):
            if forces != NULL:
                self.call(s, row)
                for i in range(self.n):
                    forces[row * s.unknowns + i] -= self.out[self.load + i]
                for k in range(self.count):
                    at = self.jacobian + self.in_jacobian[k] * self.columns
                    for i in range(self.n):
                        forces[row * s.unknowns + i] += self.out[at + i] * s.multipliers_of[row * s.multipliers + k]
            if rates != NULL and self.count:
                self.scaled(self.rates, s, row, rates)
            if errors != NULL and self.count:
                self.scaled(self.constraints, s, row, errors)
        return 0

    cdef int add_slopes(self, const states *s, matrices *to) except -1:
        cdef Py_ssize_t k, i, at, slot = 0
        self.call(s, 0)
        for i in range(3):
            for k in range(self.entries[i]):
                to.of[i * to.size + self.slots[slot]] += self.out[self.at[i] + k]
                slot += 1
        for k in range(self.count):
            at = self.jacobian + self.in_jacobian[k] * self.columns
            for i in range(self.n):
                self.bind(to, k * self.n + i, self.out[at + i])
        return 0


cdef class Added(Part):
    """Forces and slopes from Python functions: ``forces(t, q, v, a)``, (times, unknowns), ``slopes(t, q, v)``.

    Slopes (3, number of ``places``): derivatives of the force on each unknown in ``places`` by this unknown.
    ``power()``: power of loads among these forces [W] at the last states of ``forces``, (times,).
    """

    cdef object forces_of, slopes_of, power_of

    def __init__(self, forces, slopes, places, power):
        self.forces_of, self.slopes_of, self.power_of = forces, slopes, power
        self.pairs, self.bound = np.array([places, places], dtype=np.intp), np.zeros((2, 0), dtype=np.intp)

    cdef int evaluate(self, const states *s, double *forces, double *errors, double *rates) except -1:
        cdef Py_ssize_t k
        cdef double[:, ::1] found
        if forces == NULL:
            return 0
        t = np.array([s.t[k] for k in range(s.count)])
        found = np.ascontiguousarray(self.forces_of(t, *(_copied(x, s.count, s.unknowns) for x in (<uintptr_t>s.q, <uintptr_t>s.v, <uintptr_t>s.a))))
        for k in range(s.count * s.unknowns):
            forces[k] += (&found[0, 0])[k]
        return 0

    cdef int add_slopes(self, const states *s, matrices *to) except -1:
        cdef Py_ssize_t i, k
        cdef double[:, ::1] found = np.ascontiguousarray(self.slopes_of(
            np.array([s.t[0]]), *(_copied(x, 1, s.unknowns) for x in (<uintptr_t>s.q, <uintptr_t>s.v))))
        for i in range(3):
            for k in range(found.shape[1]):
                to.of[i * to.size + self.slots[k]] += found[i, k]
        return 0

    cdef double input(self, const states *s, Py_ssize_t row):
        return self.power_of()[row]


cdef object _copied(uintptr_t raw, Py_ssize_t rows, Py_ssize_t columns):
    cdef double[:, ::1] made = np.empty((rows, columns))
    memcpy(&made[0, 0], <const double *>raw, rows * columns * sizeof(double))
    return made.base


cdef class Constrained:
    """A system of parts over unknowns, multipliers and prescribed numbers.

    Parameters
    ----------
    pattern
        A :class:`symgen.runtime.elastic.large.collocation.Pattern` of the entries of all parts.
    """

    cdef tuple parts
    cdef bint loaded
    cdef envelope envelope
    cdef states at
    cdef matrices to
    cdef readonly object pattern, entries
    cdef Py_ssize_t size
    cdef Py_ssize_t[::1] first, starts, position
    cdef double[:, ::1] values

    def __init__(self, Py_ssize_t unknowns, Py_ssize_t multipliers, Py_ssize_t known, pattern, parts):
        self.pattern, self.parts, self.size = pattern, tuple(parts), pattern.size
        self.at.unknowns, self.at.multipliers, self.at.known = unknowns, multipliers, known
        self.first, self.starts, self.position = _places(pattern.first), _places(pattern.starts), _places(pattern.position)
        self.envelope.n, self.envelope.first, self.envelope.at = unknowns + multipliers, &self.first[0], &self.starts[0]
        self.loaded = any([(<Part>part).loaded for part in self.parts])
        for part in self.parts:
            _within("unknowns", part.pairs, 0, unknowns)
            _within("rows of constraints", part.bound[0], 0, multipliers)
            _within("places of constraints", part.bound[1], 0, unknowns + known)
            if isinstance(part, Rows):
                _within("places of states", part.read, 0, unknowns + known)
            part.take(pattern, unknowns)
        self.values = np.zeros((4, self.size))
        self.to.size, self.to.of = self.size, &self.values[0, 0]

    def _take(self, t, q, v, a, multipliers, known, known_rates):
        """Point to states at ``count`` times; return arrays that must stay alive."""
        cdef Py_ssize_t count = len(t), n = self.at.unknowns, m = self.at.multipliers, k = self.at.known
        rows = [np.ascontiguousarray(t, dtype=float)]
        for values, width in zip((q, v, a, multipliers, known, known_rates), (n, n, n, m, k, k)):
            # An empty array has no address.
            row = np.zeros((count, 1)) if width == 0 else np.ascontiguousarray(values, dtype=float)
            if row.shape != (count, max(width, 1)):
                raise ValueError(f"expected {count} rows of {width} numbers, got {row.shape}")
            rows.append(row)
        self.point(count, rows)
        return rows

    cdef int point(self, Py_ssize_t count, list rows) except -1:
        cdef const double[::1] t = rows[0]
        cdef const double[:, ::1] q = rows[1], v = rows[2], a = rows[3], m = rows[4], known = rows[5], moving = rows[6]
        self.at.count, self.at.t, self.at.q, self.at.v, self.at.a = count, &t[0], &q[0, 0], &v[0, 0], &a[0, 0]
        self.at.multipliers_of, self.at.known_of, self.at.known_rates = &m[0, 0], &known[0, 0], &moving[0, 0]
        return 0

    cdef int evaluate(self, double *forces, double *errors, double *rates) except -1:
        cdef Part part
        for part in self.parts:
            part.evaluate(&self.at, forces, errors, rates)
        raise_failure()
        return 0

    def forces(self, *state):
        """Return M a + ... + J^T lambda, (times, unknowns), of states: t, q, v, a, multipliers, known, known_rates."""
        kept = self._take(*state)
        cdef double[:, ::1] found = np.zeros((self.at.count, self.at.unknowns))
        self.evaluate(&found[0, 0], NULL, NULL)
        return found.base

    def rows(self, t, q, v, known, known_rates):
        """Return the constraints Phi and their rates J v + Phi_t, (times, multipliers) each."""
        cdef double[:, :, ::1] found = np.zeros((2, len(t), max(self.at.multipliers, 1)))
        kept = self._take(t, q, v, q, np.zeros((len(t), self.at.multipliers)), known, known_rates)
        self.evaluate(NULL, &found[0, 0, 0], &found[1, 0, 0])
        return found.base[:, :, :self.at.multipliers]

    def slopes(self, *state):
        """Return slopes by second rates, rates and places, and slopes of constraints, (4, slots), at one state."""
        kept = self._take(*state)
        self.refresh()
        return self.values.base.copy()

    def accelerated(self, right, *state):
        """Return second rates and multipliers for a right-hand side of M a + J^T lambda, J a, at one state."""
        cdef double[::1] x = np.zeros(len(right)), factors = np.empty(self.size)
        kept = self._take(*state)
        self.refresh()
        if not self.factor(0.0, factors, None):
            return np.full(len(right), np.nan)
        x.base[self.pattern.position] = right
        API.envelope_solve(&self.envelope, &factors[0], NULL, &x[0], NULL)
        return x.base[self.pattern.position]

    cdef int refresh(self) except -1:
        cdef Part part
        self.values[:, :] = 0.0
        for part in self.parts:
            part.add_slopes(&self.at, &self.to)
        raise_failure()
        return 0

    cdef bint factor(self, double complex g, double[::1] re, double[::1] im):
        """Factorise M + g C + g^2 K with the constraints; M alone without imaginary parts."""
        cdef Py_ssize_t k
        cdef double complex square = g * g
        cdef double[:, ::1] of = self.values
        if im is None:
            for k in range(self.size):
                re[k] = of[0, k] + of[3, k]
            return API.envelope_factor(&self.envelope, &re[0], NULL)
        for k in range(self.size):
            re[k] = of[0, k] + of[3, k] + g.real * of[1, k] + square.real * of[2, k]
            im[k] = g.imag * of[1, k] + square.imag * of[2, k]
        return API.envelope_factor(&self.envelope, &re[0], &im[0])


cdef class Steps:
    """Steps of a system by collocation: see :mod:`symgen.runtime.elastic.large.collocation`.

    Parameters
    ----------
    method
        A collocation :class:`symgen.runtime.beams.methods.BeamMethod` with an even number of stages.
    h
        Length of the steps [s].
    scale
        Sizes of the unknowns, (unknowns,).
    close
        Largest last correction of the unknowns over their sizes, and of their rates over the largest in the step.
    """

    cdef Constrained of
    cdef double h, close
    cdef Py_ssize_t stages, pairs
    cdef double[:, ::1] a, aa
    cdef double[::1] b, ba, c, scale
    cdef double complex[::1] eigenvalues
    cdef double complex[:, ::1] vectors, rows
    cdef list factors
    cdef double[::1] metric, x, y
    cdef double[:, ::1] q, v, forces, rates, change
    #: Numbers of steps and of corrections.
    cdef readonly Py_ssize_t steps, corrections

    def __init__(self, Constrained of, method, double h, scale, double close):
        self.close = close
        values, vectors = np.linalg.eig(method.a)
        # The second factor of each pair is the complex conjugate.
        pairs = np.flatnonzero(values.imag > 0.0)
        n, m, stages = of.at.unknowns, of.at.multipliers, len(method.c)
        self.of, self.h, self.stages, self.pairs = of, h, stages, len(pairs)
        arrays = method.arrays
        self.a, self.aa, self.b, self.ba, self.c = (np.ascontiguousarray(arrays[k]) for k in ("a", "aa", "b", "ba", "c"))
        self.eigenvalues, self.vectors = h * values[pairs], np.ascontiguousarray(vectors[:, pairs])
        self.rows = np.ascontiguousarray(np.linalg.inv(vectors)[pairs])
        self.factors = [np.zeros((2, of.size)) for _ in pairs]
        self.metric, self.scale = np.zeros(of.size), _numbers(scale)
        self.x, self.y = np.zeros((2, n + m + 1))
        self.q, self.v, self.forces = np.zeros((3, stages, n))
        self.rates, self.change = np.zeros((stages, max(m, 1))), np.zeros((stages, n + m))
        self.steps = self.corrections = 0

    def step(self, double t, q, v, a, multipliers, guess, known, known_rates):
        """Take a step; return places, rates, second rates and multipliers of its stages, and work. None if it fails.

        ``guess`` are second rates (stages, unknowns) and multipliers (stages, multipliers); ``known`` and
        ``known_rates`` are prescribed numbers and their rates in the middle, at the stages, and at the end.
        """
        cdef Py_ssize_t stages = self.stages
        times = t + self.h * np.concatenate([[0.5], self.c, [1.0]])
        half = q + self.h / 2 * v
        kept = self.of._take(times[:1], half[None], v[None], a[None], multipliers[None], known[:1], known_rates[:1])
        self.of.refresh()
        cdef Py_ssize_t k
        for k in range(self.pairs):
            re, im = self.factors[k]
            if not self.of.factor(self.eigenvalues[k], re, im):
                return None
        second, forces = guess[0].copy(), guess[1].copy()
        at = slice(1, 1 + stages)
        kept = self.of._take(times[at], self.q.base, self.v.base, second, forces, known[at], known_rates[at])
        if not self.corrected(q, v, second, forces):
            return None
        self.steps += 1
        return self.ended(times, q, v, second, forces, known, known_rates)

    cdef int move(self, const double[::1] q, const double[::1] v, const double[:, ::1] a) except -1:
        """Set places and rates of the stages."""
        cdef Py_ssize_t i, j, k
        cdef double place, rate
        for i in range(self.stages):
            for k in range(q.shape[0]):
                place = rate = 0.0
                for j in range(self.stages):
                    place += self.aa[i, j] * a[j, k]
                    rate += self.a[i, j] * a[j, k]
                self.q[i, k] = q[k] + self.h * (self.c[i] * v[k] + self.h * place)
                self.v[i, k] = v[k] + self.h * rate
        return 0

    cdef bint corrected(self, const double[::1] q, const double[::1] v, double[:, ::1] a, double[:, ::1] multipliers) except *:
        """Correct second rates and multipliers of the stages; False if corrections do not converge."""
        cdef Py_ssize_t i, j, k, n = q.shape[0], m = self.of.at.multipliers
        cdef double size, earlier = 0.0, before = 0.0, rate = 1.0, place, speed, fastest = _SPACING / (self.close * self.h)
        cdef int count
        for count in range(_MOST):
            self.move(q, v, a)
            # Of this step alone: a resumed run has the same bits.
            for i in range(self.stages):
                for k in range(n):
                    fastest = max(fastest, fabs(self.v[i, k]) / self.scale[k])
            self.forces[:, :] = 0.0
            self.rates[:, :] = 0.0
            self.of.evaluate(&self.forces[0, 0], NULL, &self.rates[0, 0])
            self.solve()
            size = 0.0
            for i in range(self.stages):
                for k in range(n):
                    place = speed = 0.0
                    for j in range(self.stages):
                        place += self.aa[i, j] * self.change[j, k]
                        speed += self.a[i, j] * self.change[j, k]
                    place, speed = fabs(self.h * self.h * place / self.scale[k]), fabs(self.h * speed / self.scale[k])
                    if not isfinite(place + speed):
                        return False
                    size = max(size, place, speed / fastest)
            for i in range(self.stages):
                for k in range(n):
                    a[i, k] += self.change[i, k]
                for k in range(m):
                    multipliers[i, k] += self.change[i, n + k]
            self.corrections += 1
            if count:
                rate = size / before if before else 0.0
                if before < _ROUNDING and rate > 0.5:
                    return True
                # Corrections by slopes in the middle of the step alternate.
                if size > _DIVERGING * max(before, earlier) and count > 3:
                    return False
            if size == 0.0 or size <= self.close * max(1.0, 1.0 / rate - 1.0):
                return True
            earlier, before = before, size
        return False

    cdef int solve(self) except -1:
        """Set corrections of second rates and multipliers, by the forces and rates of the stages."""
        cdef Py_ssize_t i, k, pair, at, n = self.of.at.unknowns, m = self.of.at.multipliers
        cdef double[:, ::1] factors
        cdef double complex weight, by, z
        self.change[:, :] = 0.0
        for pair in range(self.pairs):
            factors = self.factors[pair]
            by = 1.0 / self.eigenvalues[pair]
            for k in range(n + m):
                z = 0.0
                for i in range(self.stages):
                    z = z + self.rows[pair, i] * (self.forces[i, k] if k < n else self.rates[i, k - n])
                if k >= n:
                    z = z * by
                at = self.of.position[k]
                self.x[at], self.y[at] = z.real, z.imag
            API.envelope_solve(&self.of.envelope, &factors[0, 0], &factors[1, 0], &self.x[0], &self.y[0])
            for i in range(self.stages):
                weight = -2.0 * self.vectors[i, pair]
                for k in range(n + m):
                    at = self.of.position[k]
                    self.change[i, k] += weight.real * self.x[at] - weight.imag * self.y[at]
        return 0

    cdef double project(self, const double[:, ::1] rows, double[::1] values):
        """Subtract from values the least change, in the metric of the mass matrix, that satisfies the constraints."""
        cdef Py_ssize_t k, n = values.shape[0]
        cdef double size = 0.0
        for k in range(n + rows.shape[1]):
            self.x[self.of.position[k]] = 0.0 if k < n else rows[0, k - n]
        API.envelope_solve(&self.of.envelope, &self.metric[0], NULL, &self.x[0], NULL)
        for k in range(n):
            values[k] -= self.x[self.of.position[k]]
            size = max(size, fabs(self.x[self.of.position[k]]) / self.scale[k])
        return size

    cdef double work_of_loads(self, t, q, v, change, known, known_rates) except *:
        """Return the work of inertia at moving ground by a change of the rates at the end of a step [J]."""
        cdef double work = 0.0
        cdef Part part
        none = np.zeros((1, self.of.at.multipliers))
        # Power is linear in second rates.
        for sign, second in ((1.0, change), (-1.0, np.zeros_like(change))):
            kept = self.of._take(t, q[None], v[None], second[None], none, known, known_rates)
            for part in self.of.parts:
                work += sign * part.input(&self.of.at, 0)
        return work

    cdef object ended(self, times, q, v, double[:, ::1] a, double[:, ::1] multipliers, known, known_rates):
        """Return the end of a step, on the constraints; None if it fails."""
        cdef Py_ssize_t i, n = self.of.at.unknowns, stages = self.stages
        cdef double work = 0.0, power
        cdef Part part
        h, second = self.h, a.base
        for i in range(stages):
            power = 0.0
            for part in self.of.parts:
                power += part.input(&self.of.at, i) - part.dissipation(&self.of.at, i)
            work += h * self.b[i] * power
        end = q + h * v + h * h * (self.ba.base @ second)
        rate = v + h * (self.b.base @ second)
        if self.of.at.multipliers:
            last = slice(1 + stages, 2 + stages)
            # Along M^-1 J^T in the middle of the step the order of the projected rates would be lower.
            kept = self.of._take(times[last], end[None], rate[None], second[stages - 1:], multipliers.base[stages - 1:], known[last], known_rates[last])
            self.of.refresh()
            if not self.of.factor(0.0, self.metric, None):
                return None
            for _ in range(_MOST):
                errors, _ = self.of.rows(times[last], end[None], rate[None], known[last], known_rates[last])
                if not self.project(np.ascontiguousarray(errors), end) > self.close:
                    break
            at = slice(1, 2 + stages)
            places = np.vstack([self.q.base, end])
            moved = self.of.rows(times[at], places, np.zeros_like(places), known[at], known_rates[at])[1]
            work += h * float(self.b.base @ np.sum(multipliers.base * moved[:stages], axis=1))
            before = rate.copy()
            _, rates = self.of.rows(times[last], end[None], rate[None], known[last], known_rates[last])
            self.project(np.ascontiguousarray(rates), rate)
            # Impulses that put the rates on the constraints do work too; the power of the multipliers of the
            # stages alone has the fourth order.
            work -= float(moved[stages] @ self.x.base[self.of.position.base[n:n + self.of.at.multipliers]])
            if self.of.loaded:
                work += self.work_of_loads(times[last], end, rate, rate - before, known[last], known_rates[last])
        return end, rate, second, multipliers.base, work
