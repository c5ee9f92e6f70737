"""Random chains and trees written differently: turned, mirrored, moved, in other scales and orders, and back in time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import ortho_group

import symgen


def drawn(seed: int, dimension: int):
    """Return arguments of a tree, its points and their velocities (of rods that keep their lengths)."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 12))
    data = {
        "lengths": rng.uniform(0.1, 1, n),
        "masses": rng.uniform(0.1, 2, n),
        "centres": rng.uniform(0.03, 0.07, n),
        "gravity": rng.uniform(-10, 10, dimension),
        "parents": [int(rng.integers(k + 1)) for k in range(n)],
    }
    along = rng.normal(size=(n, dimension))
    along *= (data["lengths"] / np.linalg.norm(along, axis=1))[:, None]
    rates = rng.normal(size=(n, dimension))
    rates -= along * (np.sum(along * rates, axis=1) / np.sum(along**2, axis=1))[:, None]
    return data, placed(data["parents"], along), placed(data["parents"], rates)


def placed(parents, along):
    points = np.zeros((len(parents) + 1, along.shape[1]))
    for k, parent in enumerate(parents):
        points[k + 1] = points[parent] + along[k]
    return points


def solved(data, points, velocities):
    arguments = dict(data)
    chain = symgen.Chain(arguments.pop("lengths"), arguments.pop("masses"), **arguments)
    return chain, chain.accelerations(points, velocities)


@pytest.mark.parametrize("dimension", [2, 3])
def test_accelerations_and_forces_do_not_depend_on_how_a_tree_is_written(dimension):
    for seed in range(100):
        rng = np.random.default_rng([seed, 1])
        data, points, velocities = drawn(seed, dimension)
        _, before = solved(data, points, velocities)
        size, force = np.max(np.abs(before.accelerations)), np.max(np.abs(before.tensions))
        turn, shift = ortho_group.rvs(dimension, random_state=seed), rng.uniform(-2, 2, dimension)
        length, mass, time = 2.0 ** rng.integers(-9, 10, 3)
        other = data | {
            "lengths": data["lengths"] * length,
            "masses": data["masses"] * mass,
            "centres": data["centres"] * length,
            "gravity": turn @ data["gravity"] * length / time**2,
        }
        _, after = solved(other, (points @ turn.T + shift) * length, velocities @ turn.T * length / time)
        found = after.accelerations @ turn * time**2 / length
        np.testing.assert_allclose(found, before.accelerations, atol=1e-11 * size)
        found = after.tensions * time**2 / (length * mass)
        np.testing.assert_allclose(found, before.tensions, atol=1e-11 * force)

        order = reordered(data["parents"], rng)
        place = np.concatenate([[0], np.argsort(order) + 1])  # of each point in the new order
        other = data | {k: data[k][order] for k in ("lengths", "masses", "centres")}
        other["parents"] = [int(place[data["parents"][k]]) for k in order]
        rows = np.concatenate([[0], order + 1])
        _, after = solved(other, points[rows], velocities[rows])
        np.testing.assert_allclose(after.accelerations[place], before.accelerations, atol=1e-11 * size)
        np.testing.assert_allclose(after.tensions[place[1:] - 1], before.tensions, atol=1e-11 * force)


def reordered(parents, rng) -> np.ndarray:
    """Return a random order of the rods in which each follows the one that carries it."""
    order, left = [], set(range(len(parents)))
    while left:
        ready = [k for k in sorted(left) if parents[k] == 0 or parents[k] - 1 not in left]
        order.append(int(rng.choice(ready)))
        left.remove(order[-1])
    return np.array(order)


@pytest.mark.parametrize("dimension", [2, 3])
def test_motions_return_when_time_is_reversed(dimension):
    """By steps of fourth order: the error of both ways is that of halved steps, times 15."""
    for seed in range(10):
        data, points, velocities = drawn(seed, dimension)
        chain, _ = solved(data, points, velocities)
        missed = []
        for step in (4e-4, 2e-4):
            ahead = chain.simulate(0.02, points, velocities, step=step)
            back = chain.simulate(0.02, ahead.positions[-1], -ahead.velocities[-1], step=step)
            missed.append(np.max(np.abs(back.positions[-1] - points)))
        assert missed[1] < max(missed[0] / 8, 1e-12)
