"""Order of the numbers that elastic kernels write and the core reads.

``symgen generate`` writes it to ``elastic_columns.h`` of the core: enumerations for C, and the names in the
same order, which Python reads from the compiled core.
"""

from __future__ import annotations

from textwrap import fill

from symgen.mechanics.elastic.shaft import TERMS
from symgen.models.elastic.links import APPLIED, MOTION

#: For each enumeration its meaning, a prefix of its members, and their names.
COLUMNS = {
    "MOTION": (
        "a row of the kernel `links`: direction of the link, and weights of its constants, of which those\n"
        " * of the inertia of the elastic motion come first",
        "",
        MOTION,
    ),
    "APPLIED": ("a row of the kernel `loads`: weights of a force along a link", "", APPLIED),
    "SHAFT": ("the kernel `shaft`: terms of the rotation of an elastic crank with a motor", "", TERMS),
    "BLOCKS": (
        "blocks of the kernel `joints`",
        "block_",
        ("load", "mass_matrix", "damping", "stiffness", "jacobian", "jacobian_rate", "jacobian_second_rate"),
    ),
    "MATRICES": (
        "matrices of a superelement, n x n each",
        "of_",
        ("mass", "centrifugal", "gyroscopic", "stiffness", "damping", "axial0", "axial1", "axial2"),
    ),
    "VECTORS": (
        "vectors of a superelement behind its matrices, n each",
        "of_",
        ("load_x", "load_y", "load_out", "load_turn"),
    ),
    "SPREAD": (
        "of a force along a link behind them: two vectors and three matrices",
        "of_",
        ("force_x", "force_y", "force_axial", "follower_x", "follower_y"),
    ),
}


def header() -> str:
    """Return the text of the header."""
    parts = [
        "/* Order of the numbers that elastic kernels write and the core reads.\n"
        " * Written by `symgen generate` from symgen/models/elastic/columns.py. */\n"
        "#ifndef SYMGEN_ELASTIC_COLUMNS_H\n#define SYMGEN_ELASTIC_COLUMNS_H\n"
    ]
    for name, (about, prefix, members) in COLUMNS.items():
        listed = fill(", ".join((*(f"{prefix}{m}".upper() for m in members), name)), 110)
        texts = "\n".join(f'    "{line}"' for line in fill(" ".join(members), 100).split("\n"))
        texts = texts.replace('"\n    "', ' " \\\n    "')
        enum = "\n".join(f"    {line}" for line in listed.split("\n"))
        parts.append(f"/* {about}. */\nenum {{\n{enum}\n}};\n#define {name}_NAMES \\\n{texts}\n")
    return "\n".join((*parts, "#endif\n"))
