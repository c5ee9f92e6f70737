"""Errors of kernels in Python, which compiled code calls, end a run with the error itself."""

from __future__ import annotations

import ctypes
import threading

import pytest
from shared.full import full_unless

import symgen
from symgen.calls import raise_failure
from symgen.runtime.kernels import library

SCENES = {
    "four_bar": ("simulate", "equilibrium", "accelerations"),
    "crank_rocker": ("kinematics", "inverse_dynamics"),
    "slider_crank": ("inverse_dynamics",),
    "elastic_slider_crank": ("simulate",),
}


@pytest.mark.parametrize(
    ("scene", "analysis", "error"),
    full_unless(
        lambda scene, analysis, error: error is MemoryError or (scene, analysis) == ("four_bar", "simulate"),
        [(s, a, e) for s, verbs in SCENES.items() for a in verbs for e in (MemoryError, KeyboardInterrupt)],
    ),
)
def test_a_failing_kernel_ends_an_analysis_with_its_error(
    scene, analysis, error, monkeypatch, tmp_path, capsys
):
    """ctypes printed the error and went on with the outputs of the last call."""
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path))
    left = [10**9]

    def failing(function):
        def kernel(*arrays):
            left[0] -= 1
            if left[0] == 0:
                raise error("of a kernel")
            function(*arrays)

        return kernel

    monkeypatch.setattr(library, "quietly", failing)
    model = symgen.build(scene, backend="numpy")
    options = {"simulate": {"samples": 3}, "inverse_dynamics": {"samples": 3}, "kinematics": {"samples": 3}}
    model_call = lambda: getattr(model, analysis)(**options.get(analysis, {}))  # noqa: E731
    left[0] = 3
    with pytest.raises(error, match="of a kernel"):
        model_call()
    model_call()  # nothing of the failure is left
    assert "ignored" not in capsys.readouterr().err


def test_the_right_hand_side_raises_it(monkeypatch, tmp_path):
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path))
    failing = [False]

    def quietly(function):
        def kernel(*arrays):
            if failing[0]:
                raise MemoryError("of a kernel")
            function(*arrays)

        return kernel

    monkeypatch.setattr(library, "quietly", quietly)
    rhs = symgen.build("four_bar", backend="numpy").rhs
    failing[0] = True
    with pytest.raises(MemoryError, match="of a kernel"):
        rhs(0.0, rhs.start)


def test_an_error_of_a_kernel_stays_in_its_thread(monkeypatch, tmp_path):
    """It ended the call of whichever thread returned first, and made numbers of the others nan."""
    monkeypatch.setenv("SYMGEN_CACHE", str(tmp_path))

    def quietly(function):
        def kernel(*arrays):
            if threading.current_thread().name == "bad":
                raise MemoryError("of a kernel")
            function(*arrays)

        return kernel

    monkeypatch.setattr(library, "quietly", quietly)
    model = symgen.build("four_bar", backend="numpy")
    address = model.evaluator.library.addresses["points"]
    expected, raised = model.accelerations(), []

    def fail():
        ctypes.CFUNCTYPE(None, *6 * [ctypes.c_void_p])(address)(*6 * [None])  # as compiled code calls it
        here.set()
        done.wait(20)
        with pytest.raises(MemoryError, match="of a kernel"):
            raise_failure()
        raised.append(True)

    here, done = threading.Event(), threading.Event()
    bad = threading.Thread(target=fail, name="bad")
    bad.start()
    assert here.wait(20)
    try:
        found = model.accelerations()
    finally:
        done.set()
        bad.join()
    assert (found["B"] == expected["B"]).all() and raised
