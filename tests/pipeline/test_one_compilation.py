"""A scene is compiled once: the rank tolerance is an argument of the kernels, found with the start."""

from dataclasses import replace

import numpy as np

import symgen
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.toolchain.compiler import Compiler


def test_redundant_constraints_need_no_second_compilation(monkeypatch, tmp_path):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path))
    compilations, start = [], Compiler.start

    def counted(self, sources, *arguments, **options):
        compilations.append(sources)
        return start(self, sources, *arguments, **options)

    monkeypatch.setattr(Compiler, "start", counted)
    model = symgen.build("double_four_bar", backend="c")
    assert len(compilations) == 1
    assert model.redundant == ("the length of link GE",)
    assert model.description.rank_tolerance == 1e-9


def test_kernels_read_the_rank_tolerance_behind_the_parameters():
    model = symgen.build("peaucellier")
    d, state = model.description, model.initial_state()

    def multipliers(tolerance):
        evaluator = Evaluator(replace(d, rank_tolerance=tolerance), model.evaluator.library, [1.0])
        assert evaluator.parameters[-1] == tolerance
        return evaluator("accelerations", 0.0, state.q, state.u)[d.coordinates :]

    assert np.all(multipliers(d.rank_tolerance) != 0)
    # All of a pivot is a part of at most 1 of its own-signed terms: each that can cancel counts as lost.
    assert np.sum(multipliers(1.0) == 0) == 3
