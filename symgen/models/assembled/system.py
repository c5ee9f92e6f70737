"""Assembled equations of a linkage with elastic links in the plane, in letters.

The constants of every element are named, weighted by the rigid motion, turned to fixed axes and summed by the
unknowns of the linkage: Eqs. (7.28) and (8.1) of the thesis. What a run assembles numerically has the same
names: see :mod:`symgen.runtime.elastic.matrices`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import sympy as sp

from symgen.elements.element import entry_unit
from symgen.mechanics.elastic.hamilton import THESIS
from symgen.mechanics.elastic.turning_axes import COSINE, SINE, Pairs, parts_of_equation, turn
from symgen.mechanics.elastic.weights import Weight
from symgen.mechanics.sources import ASSEMBLY
from symgen.models.assembled.condensed import CONDENSED, MOTIONS, condensed
from symgen.models.assembled.mesh import Constants, ElasticStructure, Mesh, of_elements, strains
from symgen.scene.rods.linkage import Linkage
from symgen.symbolic.names import Names
from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import Definition, NamedMatrix, System

#: Parts of the equation: name in :data:`PARTS` of turning axes, unit, meaning.
MATRICES = {
    "elastic_mass": ("mass", "kg", "mass matrix"),
    "elastic_damping": ("damping", "N*s/m", "damping matrix, without damping ratios"),
    "elastic_gyroscopic": ("gyroscopic", "N*s/m", "factor of the rates by rotation of the links"),
    "elastic_stiffness": ("stiffness", "N/m", "stiffness of the structure at rest"),
    "elastic_geometric_stiffness": ("geometric", "N/m", "stiffness by forces"),
    "elastic_motion_stiffness": ("motion", "N/m", "stiffness by rotation of the links, motor and dampers"),
    "elastic_load": ("load", "N", "load of the rigid motion"),
}
#: Unit and meaning of all matrices by name.
ASSEMBLED = {
    **{name: (entry_unit(unit), about) for name, (_, unit, about) in MATRICES.items()},
    "assembly": ("1", "Z: unknowns of the elements, joints on fixed axes, by those of the linkage"),
    "boundary": ("1", "numbers of the unknowns that are zero: columns of the assembly, from 1"),
    **MOTIONS,
    "strain_recovery": ("1/m; *m per angle, *m^2 per curvature", "strain at the stations by the unknowns"),
    "stress_recovery": ("Pa/m; *m per angle, *m^2 per curvature", "stress at the stations by the unknowns"),
}
#: Unit and meaning of the constants of an element that are shown for every link, as ``LINK.NAME``.
CONSTANTS_SHOWN = {
    "mass": ("kg", "mass matrix [MD]"),
    "gyroscopic": ("kg", "gyroscopic matrix [AD]"),
    "stiffness": ("N/m", "stiffness matrix [K]"),
    "geometric0": ("1/m", "geometric stiffness of a unit axial force"),
    "load_x": ("kg", "load vector m E"),
    "load_y": ("kg", "load vector m G"),
    "load_out": ("kg*m", "load vector m N"),
    "load_turn": ("kg*m", "load vector m L"),
}
#: Entries are shared terms of elements by these parts of their names.
_ENTRY = {"mass": "M", "gyroscopic": "A", "stiffness": "K", "centrifugal": "Mc", "damping": "D"}


def assembled_system(linkage: Linkage, structure: ElasticStructure, motion: System, joints: System) -> System:
    """Return the assembled matrices in letters.

    Parameters
    ----------
    linkage
        The linkage, in letters.
    structure
        Elements and unknowns.
    motion, joints
        Systems of the inputs from the rigid motion and of all other components.
    """
    others, joined = _apart(motion.definitions, joints)
    taken = {q.name for group in motion.groups for q in group.quantities}
    taken |= {d.quantity.name for d in (*motion.definitions, *others)}
    meshes: list[Mesh] = []
    for mesh in structure.meshes:
        meshes.append(mesh.labelled({x for m in meshes for x in (m.label, *m.labels)}))
    structure, names = replace(structure, meshes=tuple(meshes)), Names(taken)
    sums = _Sums(structure)
    rows = iter(motion["loads"].matrix.tolist() if "loads" in motion else ())
    for mesh in structure.meshes:
        weights = [next(rows) for _ in mesh.profiles]
        _add_link(sums, linkage, mesh, motion, weights, names)
    rest = _at_rest(motion, (*motion.definitions, *others))
    _add_others(sums, joined, motion, structure.shaft, rest)
    matrices = [*sums.elements, *sums.matrices(), *_assembly(structure, sums)]
    matrices += _recovery(structure, linkage, motion, sums)
    if structure.pivots:
        by_name = {m.name: m.matrix for m in matrices}
        columns = [_unknown(label) for label in joined["jacobian"].columns]
        matrices += condensed(structure.pivots, joined, columns, sums.names, by_name, names)
    definitions = (*motion.definitions, *others, *names.definitions)
    return System(
        f"{linkage.name}_assembled",
        f"{linkage.title}: assembled equations of the elastic motion",
        (*motion.groups, CONDENSED) if structure.pivots else motion.groups,
        tuple(matrices),
        (),
        _used(definitions, matrices),
        references=(THESIS,),
        sources=ASSEMBLY,
    )


class _Sums:
    """Entries of the assembled matrices by the unknowns of the linkage."""

    def __init__(self, structure: ElasticStructure) -> None:
        of_links = [name for mesh in structure.meshes for name in mesh.unknowns]
        self.every = tuple(dict.fromkeys((*of_links, *structure.others)))
        self.names = tuple(name for name in self.every if name not in structure.held)
        self.place = {name: k for k, name in enumerate(self.names)}
        #: Constants of the first element of every link, in letters.
        self.elements: list[NamedMatrix] = []
        self._terms: dict[str, dict[tuple[int, int], list[sp.Expr]]] = {name: {} for name in MATRICES}

    def add(self, matrix: str, row: str, column: str, term: sp.Expr) -> None:
        """Add a term to an entry of free unknowns; ``column`` is empty for the load."""
        if term != 0 and row in self.place and (not column or column in self.place):
            at = self.place[row], self.place[column] if column else 0
            self._terms[matrix].setdefault(at, []).append(term)

    def matrices(self) -> list[NamedMatrix]:
        """Return the sums."""
        found, n = [], len(self.names)
        for name, (part, *_) in MATRICES.items():
            entries = {at: sp.Add(*terms) for at, terms in self._terms[name].items()}
            square = part != "load"
            matrix = sp.ImmutableMatrix(n, n if square else 1, lambda i, j, of=entries: of.get((i, j), 0))
            columns = self.names if square else ()
            found.append(NamedMatrix(name, matrix, *ASSEMBLED[name], self.names, columns, part == "mass"))
        return found


def _add_link(
    sums: _Sums,
    linkage: Linkage,
    mesh: Mesh,
    motion: System,
    loads: Sequence[Sequence[sp.Expr]],
    names: Names,
) -> None:
    """Add the elements of a link."""
    table = motion["links"]
    row = dict(zip(table.columns, table.matrix.row(table.rows.index(mesh.link)), strict=True))
    for k, (constants, forces) in enumerate(of_elements(linkage, mesh, motion), 1):
        label = mesh.labels[k - 1]
        at = mesh.parts[k - 1].at
        if k == 1:
            sums.elements += _element(mesh, constants)
        _add_part(sums, mesh, at, label, constants, row, names)
        for number, (force, values) in enumerate(zip(forces, loads, strict=True), 1):
            weights = dict(zip(motion["loads"].columns, values, strict=True))
            _add_force(sums, mesh, at, f"{label}_force_{number}", force, row | weights, names)


def _add_part(
    sums: _Sums, mesh: Mesh, at: Sequence[int], label: str, constants: Constants,
    weights: Mapping[str, sp.Expr], names: Names,
) -> None:  # fmt: skip
    """Add an element: constants are named, then the parts of its equation in link axes, which are turned."""
    pairs = _pairs(mesh, at)

    def named(matrix: sp.MatrixBase, of: str, about: str) -> sp.ImmutableMatrix:
        square = matrix.cols > 1
        entries = [
            names.scalar(
                f"{label}_{of}_{i + 1}" + (f"_{j + 1}" if square else ""), matrix[i, j], entry_unit("SI"),
                f"{about} of {label} in its axes, entry {i + 1}" + (f", {j + 1}" if square else ""),
            )
            for i in range(matrix.rows)
            for j in range(matrix.cols)
        ]  # fmt: skip
        return sp.ImmutableMatrix(*matrix.shape, entries)

    in_letters = {
        name: named(m, _ENTRY.get(name, name), f"constant {name.replace('_', ' ')}")
        for name, m in constants.items()
    }

    def value(w: Weight) -> sp.Expr:
        return w.value if w.value.is_number else weights[w.name]

    equation = parts_of_equation(in_letters, value, pairs)
    turned = _turned(mesh, at, weights)
    for name, (part, _, about) in MATRICES.items():
        inside = named(equation[part], part, about)
        matrix = turned * inside * (turned.T if part != "load" else 1)
        _scatter(sums, name, mesh, at, matrix)


def _pairs(mesh: Mesh, at: Sequence[int]) -> Pairs:
    """Return the places of the displacements of joints among the unknowns of an element."""
    return tuple((at.index(u), at.index(w)) for u, w in mesh.joints if u in at)


def _turned(mesh: Mesh, at: Sequence[int], weights: Mapping[str, sp.Expr]) -> sp.ImmutableMatrix:
    """Return T of an element."""
    known = {COSINE.symbol: weights["cosine"], SINE.symbol: weights["sine"]}
    return turn(len(at), _pairs(mesh, at)).xreplace(known)


def _scatter(sums: _Sums, name: str, mesh: Mesh, at: Sequence[int], matrix: sp.MatrixBase) -> None:
    unknowns = [mesh.unknowns[k] for k in at]
    for i, row in enumerate(unknowns):
        for j, column in enumerate(unknowns if matrix.cols > 1 else ("",)):
            sums.add(name, row, column, matrix[i, j])


def _element(mesh: Mesh, constants: Constants) -> Iterator[NamedMatrix]:
    """Yield the constants of the first element of a link, as they are."""
    rows = tuple(mesh.dofs[k] for k in mesh.parts[0].at)
    for name, (unit, meaning) in CONSTANTS_SHOWN.items():
        matrix = constants[name]
        columns = rows if matrix.cols > 1 else ()
        yield NamedMatrix(
            f"{mesh.link}.{name}",
            matrix,
            entry_unit(unit),
            f"{meaning}, first element of {mesh.link}",
            rows,
            columns,
        )


def _recovery(
    structure: ElasticStructure, linkage: Linkage, motion: System, sums: _Sums
) -> Iterator[NamedMatrix]:
    """Yield strains and stresses at the stations by the unknowns: s = T^T Z S and the shapes of elements."""
    table, names, strain, stress = motion["links"], [], [], []
    for mesh in structure.meshes:
        weights = dict(zip(table.columns, table.matrix.row(table.rows.index(mesh.link)), strict=True))
        modulus = next(b.modulus for b in linkage.elastic if b.link == mesh.link)
        for name, rows in strains(linkage, mesh):
            total = [sp.Integer(0)] * len(sums.names)
            for part, row in rows:
                turned = row * _turned(mesh, part.at, weights).T
                for k, entry in zip(part.at, turned, strict=True):
                    if mesh.unknowns[k] in sums.place:
                        total[sums.place[mesh.unknowns[k]]] += entry
            names.append(name)
            strain.append(total)
            stress.append([modulus * e for e in total])
    if names:
        for name, entries in (("strain_recovery", strain), ("stress_recovery", stress)):
            yield NamedMatrix(name, sp.ImmutableMatrix(entries), *ASSEMBLED[name], tuple(names), sums.names)


def _add_force(
    sums: _Sums, mesh: Mesh, at: Sequence[int], label: str, constants: Constants,
    weights: Mapping[str, sp.Expr], names: Names,
) -> None:  # fmt: skip
    """Add load and stiffness of one force along a link."""
    turned = _turned(mesh, at, weights)
    for weight, value in weights.items():
        into, _, constant = weight.partition("_")
        if weight in ("load_force_x", "load_force_y"):
            constant = weight.removeprefix("load_")
        if constant in constants and value != 0:
            factor = names.scalar(
                f"{label}_{weight}", value, "N", f"weight {weight} of a force along {mesh.link}"
            )
            matrix = turned * (factor * constants[constant]) * (turned.T if into == "stiffness" else 1)
            _scatter(
                sums, "elastic_load" if into == "load" else "elastic_geometric_stiffness", mesh, at, matrix
            )


def _add_others(
    sums: _Sums,
    joints: Mapping[str, NamedMatrix],
    motion: System,
    shaft: str,
    rest: Mapping[sp.Symbol, sp.Expr],
) -> None:
    """Add masses, dampers, springs, loads and constraint forces of all other components, and the motor."""
    for name, matrix in (("elastic_mass", "mass_matrix"), ("elastic_damping", "damping")):
        for row, column, entry in _entries(joints, matrix):
            sums.add(name, row, column, entry)
    multipliers = {q.symbol for q in motion.group("work").quantities if q.name.endswith("_lambda")}
    for row, column, entry in _entries(joints, "stiffness"):
        terms = sp.Add.make_args(entry)
        forced = [term for term in terms if term.free_symbols & multipliers]
        others = sp.Add(*(term for term in terms if not term.free_symbols & multipliers))
        still = others.xreplace(rest)
        sums.add("elastic_geometric_stiffness", row, column, sp.Add(*forced))
        sums.add("elastic_stiffness", row, column, still)
        sums.add("elastic_motion_stiffness", row, column, others - still)
    for label, entry in zip(joints["load"].rows, joints["load"].matrix, strict=True):
        sums.add("elastic_load", _unknown(label), "", entry)
    if shaft and "shaft" in motion:
        mass, damping, stiffness, load = motion["shaft"].matrix
        for name, entry in (("mass", mass), ("damping", damping), ("motion_stiffness", stiffness)):
            sums.add(f"elastic_{name}", shaft, shaft, entry)
        sums.add("elastic_load", shaft, "", load)


def _at_rest(system: System, definitions: Sequence[Definition]) -> dict[sp.Symbol, sp.Expr]:
    """Return the values of all symbols that depend on rates where rates are zero."""
    known: dict[sp.Symbol, sp.Expr] = {q.symbol: sp.Integer(0) for q in system.group("u").quantities}
    for definition in definitions:
        if definition.expression.free_symbols & known.keys():
            known[definition.quantity.symbol] = definition.expression.xreplace(known)
    return known


def _entries(joints: Mapping[str, NamedMatrix], matrix: str) -> Iterator[tuple[str, str, sp.Expr]]:
    """Yield the entries of a matrix of other components, after the unknowns of row and column."""
    if matrix in joints:
        for label, entry in zip(joints[matrix].rows, joints[matrix].matrix, strict=True):
            row, column = map(_unknown, label.split())
            yield row, column, entry


def _unknown(label: str) -> str:
    """Return the name of the unknown of a coordinate or rotation: ``A.x`` of ``A_x``."""
    point, _, axis = label.rpartition("_")
    return f"{point}.{axis}"


def _assembly(structure: ElasticStructure, sums: _Sums) -> list[NamedMatrix]:
    """Return Z and the numbers of the unknowns that are zero."""
    rows, columns = [], []
    for mesh in structure.meshes:
        for number, part in enumerate(mesh.parts, 1):
            rows += [f"{mesh.link}_{number}.{mesh.dofs[k]}" for k in part.at]
            columns += [sums.every.index(mesh.unknowns[k]) for k in part.at]
    z = sp.ImmutableMatrix(len(rows), len(sums.every), lambda i, j: int(columns[i] == j))
    numbers = {name: k for k, name in enumerate(sums.every, 1) if name in structure.held}
    zero = sp.ImmutableMatrix(len(numbers), 1, list(numbers.values()))
    return [
        NamedMatrix("assembly", z, *ASSEMBLED["assembly"], tuple(rows), sums.every),
        NamedMatrix("boundary", zero, *ASSEMBLED["boundary"], tuple(numbers)),
    ]


def _apart(known: Sequence[Definition], system: System) -> tuple[list[Definition], dict[str, NamedMatrix]]:
    """Return the definitions of a system besides known ones, renamed if names are taken, and its matrices."""
    by_name = {d.quantity.name: d.expression for d in known}
    renamed: dict[sp.Symbol, sp.Expr] = {}
    others = []
    for d in system.definitions:
        name, expression = d.quantity.name, d.expression.xreplace(renamed)
        if by_name.get(name) == expression:
            continue
        q = d.quantity
        if name in by_name:
            q = quantity(f"{name}_other", q.unit, q.description)
            renamed[d.quantity.symbol] = q.symbol
        others.append(Definition(q, expression))
    matrices = {m.name: m for m in system.matrices}
    return others, {name: _replaced(m, renamed) for name, m in matrices.items()}


def _replaced(m: NamedMatrix, renamed: Mapping[sp.Symbol, sp.Expr]) -> NamedMatrix:
    return replace(m, matrix=m.matrix.xreplace(dict(renamed)))


def _used(definitions: Sequence[Definition], matrices: Sequence[NamedMatrix]) -> tuple[Definition, ...]:
    """Return the definitions that matrices use, directly or through others."""
    needed = set[sp.Basic]().union(*(m.matrix.free_symbols for m in matrices))
    used = []
    for d in reversed(definitions):
        if d.quantity.symbol in needed:
            needed |= d.expression.free_symbols
            used.append(d)
    return tuple(reversed(used))
