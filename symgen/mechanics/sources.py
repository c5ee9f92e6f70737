"""Equations of the sources that derived matrices correspond to, by the names of the matrices.

Patterns are tried in order; a matrix that matches none is not in the source. Numbers are those of the prints.
Behind semicolons stand the equations of rows, ``fx (62a)``, of ranges, ``p12-p23 (20)``, and of entries,
``w:theta1 (6.24)``.
Where a print is wrong, the derived matrix is the corrected form (docs/errata_dual_euler.md,
docs/errata_elastic.md).

Attia: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*. Rahman: S. Rahman, *Dynamic Analysis of the
Generalized Slider Crank* (1991). Thesis: the thesis on kineto-elastodynamics.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

Sources = tuple[tuple[str, str], ...]

ROD: Sources = (
    ("particle_masses", "Attia, section 2.1"),
    ("particle_conditions", "Attia, section 2.1"),
    ("end_masses", "Attia, section 2.2: row sums are the coefficients of linear_momentum"),
    ("mass_matrix", "Attia, section 2.2: row sums are the coefficients of linear_momentum"),
    ("particle_momentum", "Attia (1)"),
    ("particle_moment", "Attia (2)"),
    ("middle_position", "Attia (3b)"),
    ("middle_velocity", "Attia (4b)"),
    ("middle_acceleration", "Attia (5b)"),
    ("linear_momentum", "Attia (6)"),
    ("angular_momentum", "Attia (7)"),
    (
        "projected_momentum",
        "Attia, section 2.2, corrected: theta in the quadrant of the rod; theta and phi are eliminated by "
        "r31_x = rho cos(theta), r31_y = rho sin(theta), rho = l cos(phi), r31_z = l sin(phi); G: the right "
        "side of angular_momentum; u_bar (8a), printed as (1); u_hat (8b), printed as (2)",
    ),
    ("distance", "Attia (3a)"),
    ("constraint", "half of distance"),
    ("velocity_constraint", "Attia (4a)"),
    ("acceleration_constraint", "Attia (5a)"),
    ("constraint_jacobian", "coefficients of the accelerations in acceleration_constraint"),
    ("acceleration_rhs", "right side of acceleration_constraint"),
)
CHAIN: Sources = (
    ("masses", "Attia (6): row sums are its coefficients"),
    ("gamma", "Attia (11), right side"),
    ("length_left", "Attia (11)"),
)
#: Of linkages: the symmetric form of [M J^T; J 0] is not in the source.
LINKAGE: Sources = (
    ("positions", "Attia, section 2.1"),
    ("velocities", "Attia, section 2.1"),
    *ROD[:2],
    ("mass_matrix", "not in the source; equivalent with J to Attia (12)-(15)"),
    ("constraints", "Attia (3a) halved; guide_* (16b)"),
    ("constraint_jacobian", "Attia (5a), coefficients of its left side"),
    ("velocity_constraints", "Attia (4a)"),
    ("acceleration_rhs", "Attia (5a), right side"),
)


def linkage_sources(bodies: Iterable[str]) -> Sources:
    """Return the sources of a linkage, with the guides by name that hold two points or more of one body."""
    parallel = "".join(f"; {guide}_* (16a), the difference of rows" for guide in bodies)
    return tuple((name, text + parallel * (name == "constraints")) for name, text in LINKAGE)


LOOP: Sources = (
    ("rows", "Rahman, table 1"),
    ("closure_defect", "Rahman (5), (6), (18), (19)"),
    ("theta2_row_operator", "Rahman (2a), (8)"),
    ("eta2_row_operator", "Rahman (2b), (9)"),
    ("theta3_row_operator", "Rahman (3a), (8)"),
    ("eta3_row_operator", "Rahman (3b), (9)"),
    ("S4_row_operator", "Rahman (4a), (10)"),
    ("*_row_operator", "as in Rahman (8)-(10)"),
    ("theta2_operator", "Rahman (12), general form (17)"),
    ("eta2_operator", "Rahman (13), general form (17)"),
    ("theta3_operator", "Rahman (14), general form (17)"),
    ("eta3_operator", "Rahman (15), general form (17)"),
    ("S4_operator", "Rahman (16), general form (17)"),
    ("*_operator", "Rahman (17)"),
    (
        "closure_step_matrix",
        "Rahman (7), (11), (19b), (23), (23a), (24): A; columns (26); p12-p23 (20), (22); d12-d23 (21)",
    ),
    (
        "closure_step_rhs",
        "Rahman (11), (19a), (23), (23a), (25), corrected, skew part of B^T: V; p12-p23 (20), (22); "
        "d12-d23 (21)",
    ),
    ("closure_jacobian", "Rahman (12)-(17), as screws"),
    ("screws", "Rahman (12)-(17), as screws"),
    ("closure_matrix", "Rahman (38), corrected, axes of eta, alpha3 varies: A"),
    ("closure_rhs", "Rahman (38), corrected, row vz: V"),
    ("screw_rates", "Rahman, section 2.8, in the first frame"),
    ("screw_drift", "Rahman, section 2.8, in the first frame"),
    (
        "inputs",
        "Rahman (27), corrected: amplitude of the rate; s1:value (28); s1:rate (28a); s1:acceleration (28b)",
    ),
    ("*_frame", "Rahman (1)-(4): the product up to the link"),
    ("*_motion", "Rahman, section 2.7, by the shorter path"),
    ("*momentum", "Rahman, section 2.8, step 2, by the shorter path"),
    ("*inertia_wrench", "Rahman, section 2.8, step 4, by the centre of mass"),
    ("joint_*_wrench", "Rahman (69a)-(69q), corrected: signs of f1, f3"),
    ("*.joint*.force", "Rahman (65)-(68), (69a)-(69q), corrected: signs of f1, f3"),
    ("*.joint*.moment", "Rahman (65)-(68), (69a)-(69q), corrected: signs of f1, f3"),
    ("*_efforts", "Rahman (62)-(64), corrected: signs of f1, f3"),
    ("*.drive", "Rahman (62)-(64), corrected: signs of f1, f3"),
    ("*transform", "Rahman (1)-(4)"),
)
#: Of velocities and momenta by both paths, link by link.
PATHS: Sources = (
    (
        "closure_of_velocities",
        "Rahman (37), corrected: axes of eta, alpha3 varies; wx (37a); vx (37b); wy (37c); vy (37d); "
        "wz (37e); vz (37f)",
    ),
    ("closure_acceleration_rhs", "Rahman, section 2.8, corrected: second dots"),
    (
        "joint_rates",
        "Rahman (39)-(43), corrected: axes of eta, alpha3 varies; theta2 (39); theta3 (40); eta2 (41); "
        "eta3 (42); S4 (43)",
    ),
    (
        "joint_accelerations",
        "Rahman (38a)-(42a), corrected: second dots, axes of eta, alpha3 varies; theta2 (38a); theta3 (39a); "
        "eta2 (40a); eta3 (41a); S4 (42a)",
    ),
    ("crank_binor", "Rahman (46), corrected: g1 = -a1/2"),
    ("rod_binor", "Rahman (47), corrected: g2 = -a2/2"),
    ("slider_binor", "Rahman (48)"),
    ("*_binor", "Rahman (46)-(48), corrected: centres of mass"),
    ("joint_1_velocity", "Rahman (29)"),
    ("joint_2_velocity", "Rahman (30), corrected: axis of eta"),
    ("joint_3_velocity", "Rahman (31), corrected: axis of eta, alpha3 varies; its negative is (31a)"),
    ("joint_4_velocity", "Rahman (32)"),
    ("joint_*_velocity", "Rahman (29)-(32), corrected: axes of eta"),
    ("rod_motion_in_2", "Rahman (34), corrected: axes of eta"),
    ("slider_motion_in_3", "Rahman (44), corrected: axes of eta, alpha3 varies"),
    ("*_motion_in_*", "as Rahman (34), (44), corrected: axes of eta"),
    ("crank_motion_forward", "Rahman (33), (33a)"),
    ("rod_motion_forward", "Rahman (35), (35a), corrected: axes of eta"),
    ("slider_motion_forward", "Rahman (45), (45a), corrected: axes of eta, alpha3 varies"),
    ("*_motion_forward", "as Rahman (33), (35), (45), corrected: axes of eta"),
    ("crank_*_backward", "not in the source"),
    ("rod_motion_backward", "Rahman (36), (36a), corrected: axes of eta, alpha3 varies"),
    ("slider_motion_backward", "Rahman (32a), (32b)"),
    ("*_motion_backward", "as Rahman (32a), (36), corrected: axes of eta"),
    ("crank_momentum_forward", "Rahman (49), (49a), corrected: g1 = -a1/2"),
    ("rod_momentum_forward", "Rahman (50), (50a), corrected: axes of eta, g2 = -a2/2"),
    ("slider_momentum_forward", "Rahman (51), (51a), corrected: axes of eta, alpha3 varies"),
    ("*_momentum_forward", "as Rahman (49)-(51), corrected: axes of eta"),
    ("rod_momentum_backward", "Rahman (52), (52a), corrected: axes of eta, alpha3 varies, g2 = -a2/2"),
    ("slider_momentum_backward", "Rahman (53), (53a)"),
    ("*_momentum_backward", "as Rahman (52), (53), corrected: axes of eta"),
    ("crank_momentum_rate_forward", "Rahman (54), corrected: second dots, g1 = -a1/2"),
    ("rod_momentum_rate_forward", "Rahman (55), corrected: second dots, axes of eta, g2 = -a2/2"),
    (
        "slider_momentum_rate_forward",
        "Rahman (56), corrected: second dots, axes of eta, alpha3 varies; px (56a); hx (56b); py (56c); "
        "hy (56d); pz (56e); hz (56f)",
    ),
    ("*_momentum_rate_forward", "as Rahman (54)-(56), corrected: second dots, axes of eta"),
    (
        "rod_momentum_rate_backward",
        "Rahman (57), corrected: second dots, axes of eta, alpha3 varies, g2 = -a2/2",
    ),
    ("slider_momentum_rate_backward", "Rahman (58), corrected: second dots"),
    ("*_momentum_rate_backward", "as Rahman (57), (58), corrected: second dots, axes of eta"),
)
#: Of the equilibrium of the links, in letters.
EQUILIBRIUM: Sources = (
    ("crank_dual_euler", "Rahman (59)"),
    ("rod_dual_euler", "Rahman (60)"),
    ("slider_dual_euler", "Rahman (61)"),
    ("*_dual_euler", "Rahman (59)-(61)"),
    ("joint_1_letters", "Rahman (65)"),
    ("joint_2_letters", "Rahman (66), which acts on the link before: minus this"),
    ("joint_3_letters", "Rahman (67)"),
    ("joint_4_letters", "Rahman (68), which acts on the link before: minus this"),
    ("joint_*_letters", "Rahman (65)-(68)"),
    (
        "crank_equilibrium",
        "Rahman (62), corrected: -f1; F2 in it is -F2 here; fx (62a), (69k); mx (62b); fy (62c); my (62d); "
        "fz (62e); mz (62f)",
    ),
    (
        "rod_equilibrium",
        "Rahman (63) times -1; F2 in it is -F2 here; fx (63a); mx (63b); fy (63c); my (63d); fz (63e); "
        "mz (63f)",
    ),
    (
        "slider_equilibrium",
        "Rahman (64), corrected: -f3, alpha3 varies; F4 in it is -F4 here; fx (64a); mx (64b); fy (64c); "
        "my (64d); fz (64e); mz (64f)",
    ),
    (
        "joint_components",
        "Rahman (69a)-(69q), corrected: signs of f1, f3; F2, F4 in it are -F2, -F4 here; F2_k (69a); "
        "F3_j (69b); F3_k (69c); T4_i (69d); T4_j (69e); T4_k (69f); F2_j (69g); F2_i (69h); F1_i (69i); "
        "F1_j (69j); F3_i (69l); F4_k (69m); F4_j (69n); F4_i (69o); T1_j (69p); T1_i (69q)",
    ),
    ("*_equilibrium", "Rahman (62)-(64), corrected: signs of f1, f3"),
)
#: Row transforms by the entries of the row that are not zero.
ROWS = {
    frozenset({"theta", "S", "a"}): "Rahman (1)",
    frozenset({"theta", "eta", "a"}): "Rahman (2)",
    frozenset({"theta", "eta", "alpha"}): "Rahman (3), corrected: alpha3 varies",
    frozenset({"S", "alpha", "a"}): "Rahman (4)",
}


def row_source(entries: Iterable[str]) -> str:
    """Return the equation of the transform of a row by the names of its entries that are not zero."""
    return ROWS.get(frozenset(entries), "general form of Rahman (1)-(4)")


#: Of any element: the form of its equation.
ELEMENT: Sources = (
    ("mass", "thesis (7.24): [M] + [B], m within the integrals"),
    ("gyroscopic", "thesis (7.25): [A] - [A]^T, m within the integrals"),
    ("stiffness", "thesis (6.14): EA and EI within the integrals"),
    ("load_x", "thesis (B.1): integral of m [D]^T (x)"),
    ("load_y", "thesis (B.4): integral of m [D]^T (X)"),
    ("load_out", "thesis (B.6): integral of m x [D]^T (x)"),
    ("load_turn", "thesis (B.7): integral of m x [D]^T (X)"),
    ("shape", "thesis (5.19), (5.20)"),
)
#: Of the element of the thesis: its printed matrices.
PRINTED_ELEMENT: Sources = (
    ("constant_mass", "thesis (F.1); [MD] of (7.28)"),
    ("constant_gyroscopic", "thesis (F.3); [AD] of (7.28)"),
    ("constant_stiffness", "thesis (6.31)-(6.33), (D.28), corrected"),
    ("constant_load_x", "thesis (B.1), times m: integral of [D]^T (x)"),
    ("constant_load_y", "thesis (B.4), (B.16), times m: integral of [D]^T (X)"),
    ("constant_load_out", "thesis (B.6), (B.18), times m: integral of x [D]^T (x)"),
    ("constant_load_turn", "thesis (B.7), (B.19), times m: integral of x [D]^T (X)"),
    (
        "shape",
        "thesis (5.3), (5.7); "
        "u (5.20), (6.16), (6.19); u (5.2), (5.5), (5.6), (C.7): steps to row u; "
        "u:u1 (6.17), corrected, (C.8), (C.10); u:u2 (6.18), (C.13); "
        "w (5.19), (6.22), (D.1); w (5.1), (5.4): steps to row w; "
        "w:w1 (6.23), (C.16); w:theta1 (6.24), (C.17); w:kappa1 (6.25), corrected, (C.18); "
        "w:w2 (6.26), (C.19); w:theta2 (6.27), (C.20); w:kappa2 (6.28), corrected, (C.21); slope (D.2); "
        "curvature (D.3), (D.4)",
    ),
    *ELEMENT,
    ("thesis_local_stiffness", "thesis (7.26), (F.5), corrected"),
    ("KD", "thesis (7.26), (F.5), corrected; [KD] of (7.28)"),
    ("Q", "thesis (F.7), corrected; (Q) of (7.28)"),
    ("KT", "thesis (E.13)-(E.17), (F.6), corrected"),
    ("thesis_mass", "thesis (E.8)-(E.12), (F.2)"),
    ("thesis_damping", "thesis (F.4), times -2 omega"),
    ("thesis_stiffness", "thesis (E.13)-(E.17), (F.6), corrected"),
    ("thesis_load", "thesis (E.20), (F.8), by the virtual work (E.18), (E.19); tapered"),
    ("global_mass", "as thesis_mass: a T that turns makes no difference"),
    ("global_load", "as thesis_load: a T that turns makes no difference"),
    ("global_*", "not in the source: the exact equation in fixed axes, where T turns"),
)
#: Of the assembled equations of elastic links: those of independent unknowns, and all.
CONDENSATION: Sources = (
    ("condensation", "thesis (E.21), (E.47)"),
    ("free_vibration", "thesis (E.22)-(E.25)"),
    ("reduced_stiffness", "thesis (E.26)"),
    ("reduced_mass", "thesis (E.27)"),
    ("reduced_gyroscopic", "thesis (E.28), times -2 omega, with rates of T"),
    ("reduced_load", "thesis (E.29)"),
)
_HALF = "(8.7), corrected: h is half of the thickness"
ASSEMBLY: Sources = (
    ("elastic_mass", "thesis (F.2)"),
    ("elastic_gyroscopic", "thesis (F.4), with rates of T"),
    ("elastic_stiffness", "thesis (D.28)"),
    ("elastic_motion_stiffness", "thesis (F.6), with rates of T"),
    ("elastic_load", "thesis (F.8)"),
    ("assembly", "thesis (8.1)"),
    ("boundary", "thesis, Fig. 22"),
    *CONDENSATION,
    ("strain_recovery", f"thesis (8.3)-(8.6); {_HALF}"),
    ("stress_recovery", f"thesis (8.3)-(8.6), (8.8); {_HALF}"),
    ("*.mass", "thesis (7.24), (F.1)"),
    ("*.gyroscopic", "thesis (7.25), (F.3)"),
    ("*.stiffness", "thesis (6.14)"),
    ("*.load_*", "thesis (7.27), (F.7)"),
)
#: Of all but the elastic links: rows of inextensible links, whose entries are cosines and sines.
JOINTS: Sources = (("jacobian", "thesis (E.30)-(E.42)"),)
#: Links of a four-bar as the thesis calls them: rows of jacobian and condensing matrix have their equations.
THESIS_LINKS = ("crank", "coupler", "output")
_FOUR_BAR_CONDENSATION = "thesis (E.21), (E.43)-(E.47)"
_INEXTENSIBLE = {
    "crank": "(E.30), (E.34), (E.40): q3 cos(theta1) + q4 sin(theta1) = 0",
    "coupler": "(E.31), (E.41): q3 cos(theta2) + q4 sin(theta2) = q7 cos(theta2) + q8 sin(theta2)",
    "output": "(E.32), (E.42): q7 cos(theta3) + q8 sin(theta3) = 0",
}


def named_joints(rows: Iterable[str]) -> Sources:
    """Return the equations of the rows of a four-bar whose links are ``THESIS_LINKS``."""
    numbers = (f"{row} {_INEXTENSIBLE[row]}" for row in rows if row in _INEXTENSIBLE)
    return (("jacobian", "; ".join(["thesis (E.30)-(E.42)", *numbers])),)


def named_condensation(crank: Sequence[str], output: Sequence[str], independent: Collection[str]) -> str:
    """Return the equations of the rows of R of such a four-bar, by the displacements of both moving joints.

    Each of (E.43)-(E.45) gives one of them by the second one of the crank; where another is independent, the
    equation is one of the rows of both.
    """
    first, second = crank
    stated = dict(zip(("(E.43)", "(E.44)", "(E.45)"), (first, *output), strict=True))
    places = []
    for row in (*crank, *output):
        own = (n for n, of in stated.items() if row in (of, second) and row not in independent)
        places.append(f"{row} {', '.join([*own, '(E.46)'])}")
    return "; ".join([_FOUR_BAR_CONDENSATION, *places])


def of_assembly(constraints: Sequence[str]) -> Sources:
    """Return the sources of the assembled equations of a linkage by its constraints, which may be none."""
    known = dict(ASSEMBLY)
    if not constraints:
        return tuple((name, text) for name, text in known.items() if name not in dict(CONDENSATION))
    if tuple(constraints) == THESIS_LINKS:
        known["condensation"] = _FOUR_BAR_CONDENSATION
    return tuple(known.items())


RIGID_ELEMENT: Sources = (
    (
        "nodal_matrix",
        "thesis (4.1), (4.10), (4.10a), left side; x (4.7); y (4.8); moment (4.9)",
    ),
    ("levers", "thesis (4.3), (4.4), at any centre of mass; R_x (4.3); R_y (4.3); S_x (4.4); S_y (4.4)"),
    ("motion", "thesis (4.2); weight: its MG; its E_T is zero here"),
    ("inertia", "thesis (4.10), (4.10a), right side; x (4.5), (4.7); y (4.5), (4.8); moment (4.6), (4.9)"),
)
#: Of a loop of links, assembled of rigid elements.
RIGID_ASSEMBLY: Sources = (
    ("rigid_elements", "thesis (4.11): L x M of (4.12), (4.13)"),
    ("rigid_assembly", "thesis (4.11), (4.15): [a], M x K of (4.13), (4.14)"),
    ("rigid_boundary", "thesis (4.16): the moments left out"),
    ("rigid_matrix", "thesis (4.11), (4.16): [D], L x L"),
    ("rigid_load", "thesis (4.16): (E)"),
)
#: Of four-bars in closed form; the numbers (4.17) to (4.27) stand apart in the copy, by order.
FOUR_BAR: Sources = (
    ("freudenstein", "thesis (4.17); output (4.17)"),
    ("ratios", "thesis (4.18)-(4.22); K1 (4.18); K2 (4.19); K3 (4.20); K4 (4.21); K5 (4.22)"),
    (
        "half_angle_coefficients",
        "thesis (4.23)-(4.27); K6 (4.23); K7 (4.24); K8 (4.25); K9 (4.26); K10 (4.27)",
    ),
    ("angles", "thesis (4.28), (4.29); theta3 (4.28); theta2 (4.29)"),
    ("angular_velocities", "thesis (4.30), (4.31); theta2_rate (4.30); theta3_rate (4.31), corrected"),
    (
        "angular_accelerations",
        "thesis (4.32), (4.33); theta2_acceleration (4.32); theta3_acceleration (4.33)",
    ),
    (
        "acceleration_terms",
        "thesis (4.34)-(4.39); H1 (4.34); H2 (4.35); H3 (4.36); H4 (4.37); H5 (4.38); H6 (4.39)",
    ),
    ("point_accelerations", "thesis (4.40), (4.41), in the plane"),
    ("joints", "thesis (4.42)-(4.45); A_x (4.42); A_y (4.43); B_x (4.44); B_y (4.45)"),
    (
        "centres",
        "thesis (4.46)-(4.51); G1_x (4.46); G1_y (4.47); G2_x (4.48); G2_y (4.49); G3_x (4.50); G3_y (4.51)",
    ),
)
#: Of limit positions: case studies I and II.
LIMITS: Sources = (
    (
        "residual",
        "thesis (3.3)-(3.17); extended_along (3.7), (3.9), (3.16); extended_across (3.6); "
        "extended_angles (3.5), corrected: -180 deg; extended_angles (3.12); folded_along (3.7); "
        "folded_across (3.14), (3.17); "
        "folded_angles (3.13); swing (3.4), (3.11); least (3.8)",
    ),
    ("coupler_by_limits", "thesis (3.15)"),
)
#: Of systems that have no counterpart in the sources.
NONE: Sources = (("", ""),)
