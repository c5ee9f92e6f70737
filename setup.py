"""Compiles what ``generated/manifest.json`` lists, and the runtime core."""

import json
import os
from pathlib import Path

from Cython.Build import cythonize
from setuptools import Extension, setup

MODELS = json.loads(Path("generated/manifest.json").read_text(encoding="utf-8"))["models"]


def flags(optimisation):
    """Return the compiler flags: no contraction, so that all processors give the same bits."""
    return [] if os.name == "nt" else [f"-O{optimisation}", "-std=c11", "-ffp-contract=off"]


CORE = [str(path) for path in sorted(Path("symgen/runtime/core").glob("*.c"))]

extensions = [
    Extension(
        "symgen.runtime._core",
        ["symgen/runtime/_core.pyx", *CORE],
        include_dirs=["symgen/runtime"],
        depends=[str(path) for path in sorted(Path("symgen/runtime/core").glob("*.h"))],
        extra_compile_args=flags(2),
    ),
    *(
        Extension(
            f"symgen.runtime.{name}",
            [f"symgen/runtime/{name}.pyx"],
            include_dirs=["symgen/runtime"],
            extra_compile_args=flags(level),
        )
        for name, level in (
            ("_foreign", 2),
            ("_follow", 3),
            ("_loop", 3),
            ("_loop_motion", 3),
            ("_bands", 3),
            ("_rigid_motion", 2),
            ("_beams", 3),
            ("_beam_steps", 3),
        )
    ),
    *(
        Extension(
            f"symgen.generated.{name}",
            [f"generated/{file}" for file in sorted(model["sources"]) if file.endswith((".pyx", ".c"))],
            include_dirs=["generated"],
            extra_compile_args=flags(model["optimisation"]),
        )
        for name, model in sorted(MODELS.items())
    ),
]

setup(
    ext_modules=cythonize(extensions, build_dir="build/cython", language_level=3),
    options={"build_ext": {"parallel": os.cpu_count()}},
)
