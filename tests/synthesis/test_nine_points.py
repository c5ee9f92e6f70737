"""Nine-point path synthesis: a published problem, whose linkages the test traces by circles itself."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from shared.full import full
from shared.linkages import circles

import symgen
from symgen.synthesis import dyads, nine_points
from symgen.synthesis.four_bar import FourBar
from symgen.synthesis.tasks import read_task

#: Problem 3 of Wampler, Morgan and Sommese (1992): 64 of its 1442 linkages are real, each with two cognates,
#: as Hauenstein and Sottile certified (algorithm 921 of the ACM's Transactions on Mathematical Software).
REAL = 64
PROBLEM_3 = (
    (0.25, 0.00), (0.52, 0.10), (0.80, 0.70), (1.20, 1.00), (1.40, 1.30), (1.10, 1.48), (0.70, 1.40),
    (0.20, 1.00), (0.02, 0.40),
)  # fmt: skip


def gap(linkage, place):
    """Return by how much the rocker's length is missed, at best, where P is on a place."""
    o, a, b, c, p = (complex(*getattr(linkage, name)) for name in "OABCP")
    place = complex(*place)
    crank, arm, far = abs(a - o), abs(p - a), abs(place - o)
    along = (crank**2 - arm**2 + far**2) / (2 * far)
    across = np.sqrt(max(crank**2 - along**2, 0.0))
    gaps = []
    for side in (1, -1):
        joint = o + (place - o) / far * (along + 1j * side * across)
        end = joint + (b - a) / (p - a) * (place - joint)
        gaps.append(abs(abs(end - c) - abs(b - c)))
    return min(gaps) / max(linkage.lengths.values())


@pytest.mark.parametrize("every", [16, full(1)])
def test_linkages_through_nine_points_come_with_their_cognates(every, monkeypatch):
    """All of them, and some; links of a cognate are its linkage's times the ratio of two sides of the coupler."""
    solutions, start = nine_points.start()
    monkeypatch.setattr(nine_points, "start", lambda: (solutions[::every], start))
    points = [[f"{x} m" for x in p] for p in PROBLEM_3]
    _, task = read_task({"kind": "path", "points": points})
    found = dyads.path(task)
    lengths = np.array([sorted(k.lengths.values()) for k in found.linkages])
    assert len(found.linkages) == 3 * REAL if every == 1 else len(found.linkages) >= 3
    assert len(found.linkages) % 3 == 0 and found.search.starts == len(solutions[::every])
    assert every > 1 or found.search.singular < 10
    for k in found.linkages:
        assert max(gap(k, place) for place in PROBLEM_3) < 1e-7
        for end in (k.A, k.B):
            ratio = np.linalg.norm(k.P - end) / k.lengths["coupler"]
            likeness = np.abs(lengths / (ratio * np.array(sorted(k.lengths.values()))) - 1).max(axis=1)
            assert likeness.min() < 1e-7


def on_an_arc(degrees):
    """Nine points of a crank-rocker at equal steps of its crank from 0.4 rad, and its lengths."""
    angles = 0.4 + np.radians(degrees) * np.arange(9) / 8
    a = 0.3 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    b = circles(a, [1.0, 0.0], 0.9, 0.7)
    along = (b - a) / 0.9
    return a + 0.4 * along + 0.5 * np.stack([-along[:, 1], along[:, 0]], axis=-1)


#: Arcs [deg], and numbers of the stored solutions that lead to the crank-rocker on the shorter ones.
ARCS = [(120, [772]), (90, [1361]), *(full(degrees, None) for degrees in (320, 180, 120, 90))]


@pytest.mark.parametrize(("degrees", "which"), ARCS)
def test_designs_whose_points_span_a_short_arc_are_found(degrees, which, monkeypatch):
    """The equations of the shortest have a condition of 7e7; all known but lost solutions are named."""
    solutions, start = nine_points.start()
    if which:
        some = solutions[which]
        monkeypatch.setattr(nine_points, "start", lambda: (some, start))
    task = {"kind": "path", "points": [[f"{x!r} m" for x in p] for p in on_an_arc(degrees).tolist()]}
    found = symgen.synthesise(task)
    lengths = {"crank": 0.3, "coupler": 0.9, "rocker": 0.7, "fixed_link": 1.0}
    errors = [max(abs(d.linkage.lengths[k] - x) for k, x in lengths.items()) for d in found.designs]
    assert min(errors) < 1e-5
    assert not found.designs[int(np.argmin(errors))].faults
    lost = found.search.singular
    assert (found.search.incomplete == "") is (lost == 0)
    assert not lost or found.search.incomplete.startswith(f"{lost} of {found.search.starts} solutions")


def test_paths_that_doubles_lose_are_followed_in_the_widest_type(monkeypatch):
    """Two solutions become ill-conditioned on their way to nine points of an arc of 120 degrees."""
    solutions, start = nine_points.start()
    places = on_an_arc(120)
    places = places / np.linalg.norm(np.ptp(places, axis=0))
    moves = (places - places[0])[1:] @ np.array([1, 1j])
    points = np.column_stack([moves, moves.conj()])
    ends, lost = nine_points.follow(solutions[[272, 947]], start, points)
    assert not lost.any()
    residual, slopes, _ = nine_points.equations(ends, points[None])
    assert np.abs(residual).max() < 1e-12 * np.abs(slopes).max()


def test_the_solutions_to_start_from_are_those_of_wampler_morgan_and_sommese():
    """1442 classes; points moved in a loop lead from some of them to others of the same set."""
    solutions, points = nine_points.start()
    assert len(nine_points.classes(solutions)) == len(solutions) == 1442
    generator = np.random.default_rng(3)
    some = solutions[generator.choice(len(solutions), 12, replace=False)]
    moved = some
    corners = [generator.normal(size=(8, 2)) + 1j * generator.normal(size=(8, 2)) for _ in range(2)]
    for here, there in pairwise([points, *corners, points]):
        moved, lost = nine_points.follow(moved, here, there)
        moved = moved[~lost]
    assert len(moved) >= 10
    assert len(nine_points.classes(np.concatenate([solutions, moved]))) == 1442
    assert len(nine_points.classes(np.concatenate([some, moved]))) > len(moved)


@pytest.mark.parametrize("more", [-1e-16, 0.0, 1e-16])
def test_one_linkage_with_equal_crank_and_rocker_is_written_in_one_way(more):
    o, a, b, c = (np.array(x) for x in ([0.0, 0.0], [0.0, 0.9 + more], [0.5, 0.9], [0.5, 0.0]))
    linkage = FourBar(o, a, b, c, np.array([0.2, 1.5]), 0.0)
    assert not dyads.is_turned(linkage, 1.0) and dyads.is_turned(dyads.exchanged(linkage), 1.0)
