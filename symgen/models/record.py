"""Derivation of a model step by step, in the order of its source, with the equation numbers of the source."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from symgen.errors import DerivationError
from symgen.methods import method_of
from symgen.scene.rods.letters import derived_in_letters
from symgen.symbolic.system import NamedMatrix, Step, System

if TYPE_CHECKING:
    from symgen.scene.loop.loop import Loop
    from symgen.scene.rods.linkage import Linkage


def record(resolved: Linkage | Loop, system: System) -> tuple[Step, ...]:
    """Return the record of a scene whose System is ``system``; elastic links have their own behind it."""
    derive = method_of(resolved).load("record")
    steps: tuple[Step, ...] = derived_in_letters(resolved, lambda written: derive(written, system))
    return steps


def of_system(system: System) -> Step:
    """Return the matrices of a system without a record of its own as one step."""
    names = tuple(m.name for m in system.matrices)
    return Step(system.title, "Matrices of this system.", "; ".join(system.references), system, names)


def of_elastic(linkage: Linkage, system: System) -> tuple[Step, ...]:
    """Return the record of a linkage and behind it that of its elastic links."""
    return (*of_linkage(linkage, system), *elastic_record())


def _rigid_assembly(linkage: Linkage) -> Iterator[Step]:
    from symgen.models.elastic.rigid_assembly import rigid_assembly_system

    if system := rigid_assembly_system(linkage):
        yield Step(
            "Rigid linkage: forces by elements",
            "Elements share the forces and moments at their nodes. Without the moments at joints that have "
            "no drive, as many remain as there are equations of balance.",
            "thesis, Eqs. (4.11)-(4.16)",
            system,
            tuple(m.name for m in system.matrices),
        )


def of_linkage(linkage: Linkage, system: System) -> Iterator[Step]:
    """Particles, energies, constraints, rows, and forces by elements of one loop."""
    masses = _masses(linkage)
    with_masses = replace(system, matrices=(*system.matrices, *masses))
    yield Step(
        "Coordinates",
        "Every point of the linkage by the Cartesian coordinates of the free ones; ground points are known.",
        "Attia, section 2.1",
        system,
        ("positions", "velocities"),
    )
    if masses:
        yield Step(
            "Particles",
            "Each link is replaced by particles at its start, middle and end with the same mass, first and "
            "second moment; the middle one moves with the mean of the ends, which leaves a constant mass "
            "matrix of the end velocities.",
            "Attia, section 2.1",
            with_masses,
            tuple(m.name for m in masses),
        )
    power = ("power",) if "power" in system else ()
    yield Step(
        "Energies",
        "Kinetic energy is a constant quadratic form of the velocities; the potential is that of gravity "
        "and springs.",
        "from the particles",
        system,
        ("kinetic_energy", "potential_energy", *power),
    )
    yield Step(
        "Mass matrix and forces",
        "The Hessian of the kinetic energy by the velocities, and minus the gradient of the potential with "
        "the work of the other loads.",
        "from the energies",
        system,
        ("mass_matrix", "force"),
    )
    if system["constraints"].matrix.rows:
        yield Step(
            "Constraints",
            "One row per constraint: the length of a rod, (d·d − l²)/2 = 0; a point on a line; a prescribed "
            "direction. Jacobian and right side follow by differentiation.",
            "Attia, Eqs. (3a) halved and (16b)",
            system,
            ("constraints", "constraint_jacobian", "velocity_constraints", "acceleration_rhs"),
        )
    yield from _momentum_rows(linkage, system)
    yield from _rigid_assembly(linkage)


def _masses(linkage: Linkage) -> list[NamedMatrix]:
    """Return masses of the particles and end masses of the links that move on two of their points."""
    from symgen.mechanics.rods.particles import end_mass, particle_masses
    from symgen.models.rods.linkage import RodsModel
    from symgen.models.rods.matrix import named

    model = RodsModel(linkage)
    rods = [k for k in model.rods if k.offset == 0]
    steps = []
    if rods:
        three = [m for k in rods for m in particle_masses(k.mass, k.length, k.centre, k.inertia)]
        about = "masses of the particles that stand for each link"
        names = [k.name for k in rods]
        particles = ("start", "middle", "end")
        steps.append(named(model, "particle_masses", three, "kg", about, rows=names, columns=particles))
    if model.rods:
        ends = [m for k in model.rods for m in end_mass(k.mass, k.length, k.centre, k.inertia, k.offset)]
        about = "mass matrix of the end velocities of each link: a11, a12, a22, and the coupling of its axes"
        names = [k.name for k in model.rods]
        entries = ("a11", "a12", "a22", "cross")
        steps.append(named(model, "end_masses", ends, "kg", about, rows=names, columns=entries))
    return steps


def _momentum_rows(linkage: Linkage, system: System) -> Iterator[Step]:
    from symgen.models.momentum.rows import momentum_system

    try:
        rows = momentum_system(linkage)
    except DerivationError as error:
        yield Step("Momentum rows", f"Not derived: {error}.", "Attia, Eqs. (12)-(16)", system)
        return
    names = tuple(m.name for m in rows.matrices if m.name not in ("matrix", "rhs"))
    yield Step(
        "Momentum rows",
        "The source's own form, for comparison: the moment of momentum of all that is outboard of a joint "
        "about it, the linear momentum, and the constraints twice differentiated; each row is zero along the "
        "motion.",
        "Attia, Eqs. (12)-(16)",
        rows,
        names,
    )


def of_loop(loop: Loop, system: System) -> Iterator[Step]:
    """Rows, closure, screws, motion, inertia, equilibrium."""

    def ending(*words: str) -> tuple[str, ...]:
        return tuple(m.name for m in system.matrices if m.name.endswith(words) and "." not in m.name)

    def known(*names: str) -> tuple[str, ...]:
        return tuple(name for name in names if name in system)

    joints = tuple(name for name in ending("_wrench") if name.startswith("joint_"))

    for title, about, source, names in (
        (
            "Table and row transforms",
            "Row i places frame {i+1} in frame {i}: T = Z(θ + εS) Y(η) X(α + εa), a dual matrix, real part "
            "| dual part.",
            "Rahman, Eqs. (1)-(4)",
            ("rows", *ending("_transform")),
        ),
        (
            "Closure",
            "The product of all row transforms is the identity: B = T₁ T₂ ⋯ Tₙ = 1. The residual B − 1 is "
            "the closure defect.",
            "Rahman, Eqs. (5)-(11), (18)",
            ("closure_defect",),
        ),
        (
            "Screws",
            "A joint variable moves all following links about its own axis: ∂T/∂q = Q T of its row, ∂B/∂q = "
            "H B, where H is the operator of its screw.",
            "Rahman, Eqs. (2a)-(4a), (8)-(17)",
            (*ending("_operator"), "closure_jacobian", "screws"),
        ),
        (
            "Newton's step",
            "To the first order the sum of H δq is Bᵀ − 1, and both are skew: the entries above the "
            "diagonal are A δq = V.",
            "Rahman, Eqs. (19)-(26), corrected",
            ("closure_step_matrix", "closure_step_rhs"),
        ),
        (
            "Velocities and accelerations",
            "Screws times rates sum to zero round the loop, and so do their rates; partial sums are "
            "the motions of the links.",
            "Rahman, Eqs. (29)-(45), corrected",
            (
                *known("inputs"),
                "closure_matrix",
                "closure_rhs",
                *ending("_frame", "_motion", "_motion_rate"),
                "screw_drift",
            ),
        ),
        (
            "Momenta and inertia wrenches",
            "The inertia binor of a link times its dual velocity is its momentum; the inertia wrench is "
            "the rate of the momentum.",
            "Rahman, Eqs. (46)-(61), corrected",
            ending("_binor", "_momentum", "_inertia_wrench"),
        ),
        (
            "Joint wrenches",
            "The loop is cut at the ground; every wrench follows from the closing wrench and the links "
            "outboard. The effort at a variable is the product of its screw and the wrench of its joint.",
            "Rahman, Eqs. (62)-(64)",
            (*joints, *known("inverse_efforts", "given_efforts")),
        ),
        (
            "Forward dynamics",
            "The derivative of the efforts by the accelerations, contracted with the motions that closure "
            "leaves free.",
            "not in the source",
            known("mass_matrix"),
        ),
    ):
        if names and title == "Joint wrenches":
            yield _equilibrium(loop)
        if names:
            yield Step(title, about, source, system, names)
        if title == "Momenta and inertia wrenches":
            yield from _by_both_paths(loop)


def _by_both_paths(loop: Loop) -> Iterator[Step]:
    """Yield closure of accelerations, velocities and momenta of the links by the two paths."""
    from symgen.models.loop.momenta import closure_system, path_system

    system = closure_system(loop)
    yield Step(
        system.title,
        "The rate of the closure of velocities has the same matrix; its right side is the difference of both "
        "paths without the accelerations of dependent variables.",
        "Rahman, Eqs. (38a)-(42a), corrected",
        system,
        tuple(m.name for m in system.matrices),
    )
    for path, about in (
        (
            "forward",
            "The velocity of a link is that of the link before it and that of their joint, carried to its "
            "frame.",
        ),
        (
            "backward",
            "The velocity of a link is that of the link behind it, carried to its frame, less that of "
            "their joint.",
        ),
    ):
        system = path_system(loop, path)
        names = tuple(m.name for m in system.matrices)
        yield Step(system.title, about, "Rahman, Eqs. (29)-(58), corrected", system, names)


def _equilibrium(loop: Loop) -> Step:
    """Return the equilibrium of the links with letters for the wrenches."""
    from symgen.models.loop.equilibrium import equilibrium_system

    system = equilibrium_system(loop)
    return Step(
        "Dual Euler equations and equilibrium of the links",
        "The inertia wrench is the rate of the dual momentum. The wrench of the joint before a link, carried "
        "to its frame, less that of the joint behind it, is the inertia wrench less that of the loads.",
        "Rahman, Eqs. (59)-(64), signs corrected",
        system,
        tuple(m.name for m in system.matrices),
    )


def elastic_record(of_element: System | None = None) -> tuple[Step, ...]:
    """Return Hamilton's principle for an elastic link; each matrix names its source equation.

    The last step has the further matrices of an element, if its system is given.
    """
    from symgen.mechanics.elastic.letters import assembly_equations, condensed_equations, element_equations
    from symgen.models.elastic.derivation import elastic_derivation_system

    system = of_element or elastic_derivation_system()
    steps = tuple(
        Step(title, about, source, system, names)
        for title, about, source, names in (
            (
                "Elastic link: place and velocity",
                "A point of the link in axes that turn with it, and its absolute velocity by components in "
                "them.",
                "thesis, Eqs. (6.1)-(6.10)",
                ("place", "velocity", "origin_acceleration"),
            ),
            (
                "Elastic link: energies",
                "Kinetic energy, strain energy, and the work of gravity and of the axial force, each per "
                "length.",
                "thesis, Eqs. (6.12)-(6.15), with omitted terms added",
                (
                    "kinetic_energy",
                    "kinetic_terms",
                    "shear_strain",
                    "strain_energy",
                    "axial_force",
                    "geometric_energy",
                    "gravity_work",
                    "applied_work",
                    "follower_force",
                ),
            ),
            (
                "Elastic link: variation",
                "Hamilton's principle: the factor of the variation of each field, then integrated by parts "
                "in time.",
                "thesis, Eqs. (7.8)-(7.23)",
                ("variation", "weak_form"),
            ),
            (
                "Elastic link: collected terms",
                "What stands with second rates, with rates, with the fields, and alone: mass, gyroscopic "
                "and stiffness matrices and loads of any element follow by integration over its shapes.",
                "thesis, Eqs. (7.24)-(7.27)",
                ("mass_terms", "gyroscopic_terms", "stiffness_terms", "load_terms"),
            ),
        )
    )
    known = {name for step in steps for name in step.names}
    further = tuple(m.name for m in system.matrices if m.name not in known)
    if further:
        about = "The fields by the unknowns of an element, and integrals of their products along it."
        source = "thesis, Chapter VI, Appendices A to E"
        steps = (*steps, Step("Elastic link: fields of an element", about, source, system, further))
    letters = [(element_equations(), "thesis, Eqs. (5.16)-(7.28)")]
    if of_element is None:
        letters.append((assembly_equations(), "thesis, Eq. (8.1)"))
        letters.append((condensed_equations(), "thesis, Eqs. (E.22)-(E.29)"))
    about = "The equations as the thesis prints them; symgen show lists the matrix of each letter below them."
    return (
        *steps,
        *(Step(x.title, about, source, x, tuple(m.name for m in x.matrices)) for x, source in letters),
    )
