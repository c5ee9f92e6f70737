"""Equations of the sources that derived matrices correspond to, by the names of the matrices.

Patterns are tried in order; a matrix that matches none is not in the source. Numbers are those of the prints.
Where a print is wrong, the derived matrix is the corrected form (docs/errata_dual_euler.md,
docs/errata_elastic.md).

Attia: H. A. Attia, *Dynamic Analysis of a Chain of Rigid Rods*. Rahman: S. Rahman, *Dynamic Analysis of the
Generalized Slider Crank* (1991). Thesis: the thesis on kineto-elastodynamics.
"""

from __future__ import annotations

from collections.abc import Iterable

Sources = tuple[tuple[str, str], ...]

ROD: Sources = (
    ("particle_masses", "Attia, section 2.1"),
    ("particle_conditions", "Attia, section 2.1"),
    ("end_masses", "Attia (6): row sums are its coefficients"),
    ("mass_matrix", "Attia (6): row sums are its coefficients"),
    ("particle_momentum", "Attia (1)"),
    ("particle_moment", "Attia (2)"),
    ("middle_position", "Attia (3b)"),
    ("middle_velocity", "Attia (4b)"),
    ("middle_acceleration", "Attia (5b)"),
    ("linear_momentum", "Attia (6)"),
    ("angular_momentum", "Attia (7)"),
    ("projected_momentum", "Attia (8a), (8b), printed as (1), (2)"),
    ("constraint", "Attia (3a), halved"),
    ("constraint_jacobian", "Attia (5a), left side"),
    ("velocity_constraint", "Attia (4a)"),
    ("acceleration_rhs", "Attia (5a), right side"),
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
    ("constraints", "Attia (3a) halved, (16a), (16b)"),
    ("constraint_jacobian", "Attia (5a), left side"),
    ("velocity_constraints", "Attia (4a)"),
    ("acceleration_rhs", "Attia (5a), right side"),
)
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
    ("closure_step_matrix", "Rahman (7), (11), (19b), (23), (23a), (24): A; columns (26)"),
    ("closure_step_rhs", "Rahman (19a), (20)-(22), (23a), (25), corrected: V"),
    ("closure_jacobian", "Rahman (12)-(17), as screws"),
    ("screws", "Rahman (12)-(17), as screws"),
    ("closure_matrix", "Rahman (37)-(37f), (38), corrected: A; (39)-(43) solve it"),
    ("closure_rhs", "Rahman (37)-(37f), (38), corrected: V; (39)-(43) solve it"),
    ("screw_rates", "Rahman (38a)-(42a), corrected"),
    ("screw_drift", "Rahman (38a)-(42a), corrected"),
    ("inputs", "Rahman (27), (28), (28a), (28b), corrected"),
    ("*_frame", "Rahman (1)-(4): the product up to the link"),
    ("crank_motion", "Rahman (29), (33), (33a)"),
    ("rod_motion", "Rahman (30), (34), (35), (35a), (36), (36a), corrected"),
    ("slider_motion", "Rahman (31), (31a), (32), (32a), (32b), (44), (45), (45a), corrected"),
    ("*_motion", "Rahman (33)-(45), corrected"),
    ("crank_binor", "Rahman (46), corrected"),
    ("rod_binor", "Rahman (47), corrected"),
    ("slider_binor", "Rahman (48), corrected"),
    ("*_binor", "Rahman (46)-(48), corrected"),
    ("crank_momentum", "Rahman (49), (49a), corrected"),
    ("rod_momentum", "Rahman (50), (50a), (52), (52a), corrected"),
    ("slider_momentum", "Rahman (51), (51a), (53), (53a), corrected"),
    ("*momentum", "Rahman (49)-(51), corrected"),
    ("crank_inertia_wrench", "Rahman (54), (59), corrected"),
    ("rod_inertia_wrench", "Rahman (55), (57), (60), corrected"),
    ("slider_inertia_wrench", "Rahman (56)-(56f), (58), (61), corrected"),
    ("*inertia_wrench", "Rahman (54)-(61), corrected"),
    ("joint_1_wrench", "Rahman (65), (69a)-(69q), corrected"),
    ("joint_2_wrench", "Rahman (66), (69a)-(69q), corrected"),
    ("joint_3_wrench", "Rahman (67), (69a)-(69q), corrected"),
    ("joint_4_wrench", "Rahman (68), (69a)-(69q), corrected"),
    ("joint_*_wrench", "Rahman (65)-(68), (69a)-(69q), corrected"),
    ("*.joint*.force", "Rahman (65)-(68), (69a)-(69q), corrected"),
    ("*.joint*.moment", "Rahman (65)-(68), (69a)-(69q), corrected"),
    ("*_efforts", "Rahman (62)-(64), corrected"),
    ("*.drive", "Rahman (62)-(64), corrected"),
    ("*transform", "Rahman (1)-(4)"),
)
#: Of the equilibrium of the links, in letters.
EQUILIBRIUM: Sources = (
    ("crank_equilibrium", "Rahman (62), signs corrected"),
    ("rod_equilibrium", "Rahman (63), signs corrected"),
    ("slider_equilibrium", "Rahman (64), signs corrected"),
    ("*_equilibrium", "Rahman (62)-(64), signs corrected"),
)
#: Row transforms by the entries of the row that are not zero.
_ROWS = {
    frozenset({"theta", "S", "a"}): "Rahman (1)",
    frozenset({"theta", "eta", "a"}): "Rahman (2)",
    frozenset({"theta", "eta", "alpha"}): "Rahman (3)",
    frozenset({"S", "alpha", "a"}): "Rahman (4)",
}


def row_source(entries: Iterable[str]) -> str:
    """Return the equation of the transform of a row by the names of its entries that are not zero."""
    return _ROWS.get(frozenset(entries), "general form of Rahman (1)-(4)")


#: Of any element: the form of its equation.
ELEMENT: Sources = (
    ("mass", "thesis (7.24): [M] + [B], m within the integrals"),
    ("gyroscopic", "thesis (7.25): [A] - [A]^T, m within the integrals"),
    ("stiffness", "thesis (6.14), (6.20), (6.21), (6.29)-(6.33)"),
    ("load_x", "thesis (B.1): integral of m [D]^T (x)"),
    ("load_y", "thesis (B.4): integral of m [D]^T (X)"),
    ("load_out", "thesis (B.6): integral of m x [D]^T (x)"),
    ("load_turn", "thesis (B.7): integral of m x [D]^T (X)"),
    ("shape", "thesis (5.23)"),
)
#: Of the element of the thesis: its printed matrices.
PRINTED_ELEMENT: Sources = (
    ("constant_mass", "thesis (F.1)"),
    ("constant_gyroscopic", "thesis (F.3)"),
    ("constant_stiffness", "thesis (D.4)-(D.27), (D.28), corrected"),
    ("constant_load_x", "thesis (B.1), times m: integral of [D]^T (x)"),
    ("constant_load_y", "thesis (B.4), (B.16), times m: integral of [D]^T (X)"),
    ("constant_load_out", "thesis (B.6), (B.18), times m: integral of x [D]^T (x)"),
    ("constant_load_turn", "thesis (B.7), (B.19), times m: integral of x [D]^T (X)"),
    (
        "shape",
        "thesis (5.1)-(5.23), (6.16)-(6.19), (6.22)-(6.28), (B.8), (C.1)-(C.21), (D.1)-(D.3), corrected",
    ),
    *ELEMENT,
    ("thesis_local_stiffness", "thesis (7.26), (F.5), corrected"),
    ("KD", "thesis (7.26), (F.5), corrected"),
    ("KT", "thesis (E.13)-(E.17), (F.6), corrected"),
    ("thesis_mass", "thesis (E.8)-(E.12), (F.2)"),
    ("thesis_damping", "thesis (F.4), times -2 omega"),
    ("thesis_stiffness", "thesis (E.13)-(E.17), (F.6), corrected"),
    ("thesis_load", "thesis (E.18)-(E.20), (F.8)"),
    ("global_*", "not in the source: exact form of thesis (7.28) in fixed axes"),
)
#: Of the assembled equations of elastic links.
ASSEMBLY: Sources = (
    ("elastic_mass", "thesis (F.2), (8.1)"),
    ("elastic_gyroscopic", "thesis (F.4), (8.1), with rates of T"),
    ("elastic_stiffness", "thesis (D.28), (8.1)"),
    ("elastic_motion_stiffness", "thesis (F.6), (8.1), with rates of T"),
    ("elastic_load", "thesis (F.8), (8.1)"),
    ("assembly", "thesis (8.1)"),
    ("boundary", "thesis Fig. 22, (8.2)"),
    ("condensation", "thesis (E.21)-(E.29), (E.43)-(E.47)"),
    ("strain_recovery", "thesis (8.3)-(8.7)"),
    ("stress_recovery", "thesis (8.3)-(8.8)"),
    ("*.mass", "thesis (7.24), (F.1)"),
    ("*.gyroscopic", "thesis (7.25), (F.3)"),
    ("*.stiffness", "thesis (6.14)"),
    ("*.load_*", "thesis (7.27), (F.7)"),
)
#: Of all but the elastic links: rows of inextensible links, whose entries are cosines and sines.
JOINTS: Sources = (("jacobian", "thesis (E.30)-(E.42)"),)
RIGID_ELEMENT: Sources = (
    ("nodal_matrix", "thesis (4.1)-(4.9), (4.10)"),
    ("inertia", "thesis (4.10), right side"),
)
#: Of limit positions: case studies I and II.
LIMITS: Sources = (("residual", "thesis (3.3)-(3.17), corrected"),)
#: Of systems that have no counterpart in the sources.
NONE: Sources = (("", ""),)
