"""Chains and trees against 30-digit solutions of their whole systems, closed forms and scenes."""

from __future__ import annotations

from math import sqrt

import mpmath
import numpy as np
import pytest
from shared.full import full_unless
from shared.golden import reference

import symgen
from symgen.errors import ModelError, ResultError, SimulationError
from symgen.runtime.kernels.library import shipped_module

DIGITS, GUARD = 30, 30
GRAVITY = {2: (0.3, -9.81), 3: (0.2, -0.4, -9.81)}


def exact(chain, along, rates, forces=None, base=None):
    """Solve [M J^T; J 0] of all points at once with mpmath, from the particle form of each rod's mass."""
    n, dim = chain.rods, chain.dimension
    with mpmath.workdps(DIGITS + GUARD):
        f = mpmath.mpf
        size = (n + 1) * dim
        whole, rhs = mpmath.zeros(size + n), mpmath.zeros(size + n, 1)
        for p in range(n + 1):
            for i in range(dim):
                given = 0 if forces is None else f(float(forces[p, i]))
                whole[p * dim + i, p * dim + i] += f(float(chain.point_masses[p]))
                rhs[p * dim + i] += given + f(float(chain.point_masses[p])) * f(float(chain.gravity[i]))
        for k in range(n):
            m, l, c, inertia = (
                f(float(x[k])) for x in (chain.masses, chain.lengths, chain.centres, chain.inertias)
            )
            about = inertia + m * c**2
            middle = 4 * (m * l * c - about) / l**2
            end = 2 * (about - m * l * c / 2) / l**2
            ends = [int(chain.parents[k]), k + 1]
            masses = [[m - middle - end + middle / 4, middle / 4], [middle / 4, end + middle / 4]]
            for i in range(dim):
                for x in range(2):
                    for y in range(2):
                        whole[ends[x] * dim + i, ends[y] * dim + i] += masses[x][y]
                    rhs[ends[x] * dim + i] += sum(masses[x]) * f(float(chain.gravity[i]))
                d = f(float(along[k, i]))
                for p, sign in zip(ends, (-1, 1), strict=True):
                    whole[p * dim + i, size + k] += sign * d
                    whole[size + k, p * dim + i] += sign * d
            rhs[size + k] = -sum(f(float(w)) ** 2 for w in rates[k])
        free = list(range(size + n))
        known = {}
        if chain.pinned:
            known = {i: f(float(base[i])) if base is not None else f(0) for i in range(dim)}
            free = free[dim:]
        inner = mpmath.matrix([[whole[i, j] for j in free] for i in free])
        right = mpmath.matrix([rhs[i] - sum(whole[i, j] * v for j, v in known.items()) for i in free])
        found = [*known.values(), *mpmath.lu_solve(inner, right)]
        reaction = [sum(whole[i, j] * found[j] for j in range(size + n)) - rhs[i] for i in range(dim)]
        return np.array(found[:size]).reshape(n + 1, dim), np.array(found[size:]), np.array(reaction)


def error(found, truth):
    size = max((abs(x) for x in np.ravel(truth)), default=1) or 1
    return float(max(abs(x - y) for x, y in zip(np.ravel(found), np.ravel(truth), strict=True)) / size)


def errors(chain, motion, along, rates, **known):
    a, lam, reaction = exact(chain, along, rates, **known)
    found = [error(motion.accelerations, a), error(motion.multipliers, lam)]
    return max([*found, error(motion.reaction, reaction)] if chain.pinned else found)


def random_chain(seed, dimension, rods, *, tree, pinned):
    rng = np.random.default_rng(seed)
    lengths, masses = rng.uniform(0.2, 2, rods), rng.uniform(0.3, 3, rods)
    centres = lengths * rng.uniform(0.2, 0.9, rods)
    chain = symgen.Chain(
        lengths,
        masses,
        centres=centres,
        inertias=masses * lengths**2 * rng.uniform(0.02, 0.5, rods),
        parents=[int(rng.integers(0, k + 1)) for k in range(rods)] if tree else None,
        point_masses=rng.uniform(0, 1, rods + 1),
        pinned=pinned,
        gravity=GRAVITY[dimension],
    )
    along, rates = random_state(rng, chain)
    return chain, along, rates, rng.standard_normal((rods + 1, dimension))


def random_state(rng, chain, batch=()):
    along = rng.standard_normal((*batch, chain.rods, chain.dimension))
    along *= chain.lengths[:, None] / np.linalg.norm(along, axis=-1, keepdims=True)
    rates = rng.standard_normal(along.shape)
    rates -= along * (np.sum(along * rates, -1, keepdims=True) / np.sum(along**2, -1, keepdims=True))
    return along, rates


@pytest.mark.parametrize("pinned", [True, False], ids=["pinned", "free"])
@pytest.mark.parametrize("tree", [False, True], ids=["chain", "tree"])
@pytest.mark.parametrize("rods", [1, 2, 3, 7])
@pytest.mark.parametrize("dimension", [2, 3])
def test_against_the_whole_system_at_30_digits(dimension, rods, tree, pinned):
    for seed in range(2):
        chain, along, rates, forces = random_chain(seed, dimension, rods, tree=tree, pinned=pinned)
        base = np.arange(1.0, dimension + 1) if pinned else None
        motion = chain.accelerations(along=along, rates=rates, forces=forces, base=base)
        assert errors(chain, motion, along, rates, forces=forces, base=base) <= 1e-12
        refined = chain.accelerations(along=along, rates=rates, forces=forces, base=base, refinements=2)
        # Of a free chain gravity cancels in the multipliers, and rounded masses are what is left of it.
        assert errors(chain, refined, along, rates, forces=forces, base=base) <= (2e-15 if pinned else 1e-14)


def from_reference(name):
    numbers = reference(f"rods_{name}")
    rods = numbers["rods"]
    m, l, c, about = (np.array([float(r[k]) for r in rods]) for k in ("m", "l", "lc", "Io"))
    chain = symgen.Chain(
        l, m, centres=c, inertias=about - m * c**2, gravity=[float(g) for g in numbers["gravity"]]
    )
    return chain, {k: np.array(numbers[k], dtype=float) for k in ("pos", "vel", "acc", "lambda_rods")}


@pytest.mark.parametrize(
    "name",
    [
        "triple_pendulum_planar",
        "triple_pendulum_planar_rest_horizontal",
        "double_pendulum_spatial",
        "double_pendulum_spatial_exactly_vertical",
    ],
)
def test_reference_numbers(name):
    chain, numbers = from_reference(name)
    motion = chain.accelerations(numbers["pos"], numbers["vel"])
    assert error(motion.accelerations, numbers["acc"]) <= 1e-12
    assert error(motion.multipliers, numbers["lambda_rods"]) <= 1e-12
    (reaction,) = reference(f"rods_{name}")["ground_reaction"].values()
    assert error(motion.reaction, np.array(reaction, dtype=float)) <= 1e-12


@pytest.mark.parametrize("rods, expected", [(1, -3 / 2), (2, -9 / 7), (3, -33 / 26), (3000, -(3 - sqrt(3)))])
@pytest.mark.parametrize("axis", [(1.0, 0.0), (0.6, 0.8)])
def test_straight_chain_released_from_rest(rods, expected, axis):
    """Across a straight uniform chain, the first joint falls by a rational multiple of gravity."""
    chain = symgen.Chain(np.ones(rods), np.ones(rods), gravity=(axis[1], -axis[0]))
    motion = chain.accelerations(np.outer(np.arange(rods + 1), axis))
    across = motion.accelerations @ np.array([-axis[1], axis[0]])
    assert across[1] == pytest.approx(expected, abs=1e-13)
    if rods > 100:
        assert across[-1] == pytest.approx(-1, rel=0.3)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_tree_agrees_with_the_scene_of_it(dimension):
    parents = [0, 1, 1, 0]
    names = ["O", "A", "B", "C", "D"]
    chain = symgen.Chain(
        [0.8, 0.5, 0.6, 0.7], [1.2, 0.7, 0.4, 0.9], parents=parents, gravity=GRAVITY[dimension]
    )
    along, rates = random_state(np.random.default_rng(3), chain)
    p, v = np.zeros((2, 5, dimension))
    for k, inner in enumerate(parents):
        p[k + 1], v[k + 1] = p[inner] + along[k], v[inner] + rates[k]
    scene = symgen.Scene(
        points={
            name: {"at": [f"{x!r} m" for x in at.tolist()]} | ({"ground": True} if name == "O" else {})
            for name, at in zip(names, p, strict=True)
        },
        links={
            f"rod{k}": {"points": [names[inner], names[k + 1]], "mass": f"{chain.masses[k]} kg"}
            for k, inner in enumerate(parents)
        },
        gravity={"acceleration": [f"{g!r} m/s^2" for g in GRAVITY[dimension]]},
    )
    model = symgen.build(scene)
    state = model.state(dict(zip(names, p, strict=True)), dict(zip(names, v, strict=True)))
    found, motion = model.accelerations(state), chain.accelerations(p, v)
    for name, a in zip(names, motion.accelerations, strict=True):
        assert np.allclose(found[name], a, rtol=0, atol=1e-12 * np.abs(motion.accelerations).max())
    lams = [found.multipliers[f"rod{k}"] for k in range(4)]
    assert error(motion.multipliers, lams) <= 1e-12
    assert error(motion.reaction, found.reactions["O"]) <= 1e-12


@pytest.mark.parametrize(
    ("dimension", "case"),
    full_unless(
        lambda dimension, case: dimension == 3 and case in ("tip 1e6", "masses 1 to 1e12", "lengths 1e6", "straight 45"),
        [
            (dimension, case)
            for dimension in (2, 3)
            for case in (
                "tip 1e6", "masses 1 to 1e12", "alternating 1e6", "lengths 1e6", "far centre", "straight 45",
            )
        ],
    ),
)  # fmt: skip
def test_bad_scales_are_refined(dimension, case):
    n = 12
    lengths, masses, points, options = np.ones(n), np.ones(n), np.zeros(n + 1), {}
    if case == "tip 1e6":
        points[-1] = 1e6
    elif case == "masses 1 to 1e12":
        masses = np.logspace(0, 12, n)
    elif case == "alternating 1e6":
        masses[::2] = 1e6
    elif case == "lengths 1e6":
        lengths[::2] = 1e-6
    elif case == "far centre":
        options = {"centres": 3 * lengths, "inertias": 100 * masses * lengths**2}
    chain = symgen.Chain(lengths, masses, point_masses=points, gravity=GRAVITY[dimension], **options)
    along, rates = random_state(np.random.default_rng(1), chain)
    if case == "straight 45":
        along, rates = np.ones_like(along) / sqrt(dimension), 0 * rates
    motion = chain.accelerations(along=along, rates=rates)
    assert errors(chain, motion, along, rates) <= 1e-13
    twice = chain.accelerations(along=along, rates=rates, refinements=2)
    assert errors(chain, twice, along, rates) <= 1e-13


def test_cancellation_warns_of_lost_digits():
    heavy = symgen.Chain(np.ones(8), np.ones(8), point_masses=[0] * 8 + [1e6])
    along, rates = random_state(np.random.default_rng(1), heavy)
    assert heavy.accelerations(along=along, rates=rates).cancellation.max() > 1e3
    plain = heavy.accelerations(along=along, rates=rates, refinements=0)
    assert errors(heavy, plain, along, rates) > 1e-15


@pytest.mark.parametrize("pinned", [True, False], ids=["pinned", "free"])
@pytest.mark.parametrize("tree", [False, True], ids=["chain", "tree"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_many_are_one_by_one_bit_for_bit(dimension, tree, pinned):
    chain, *_ = random_chain(4, dimension, 9, tree=tree, pinned=pinned)
    rng = np.random.default_rng(0)
    along, rates = random_state(rng, chain, (5, 11))
    forces = rng.standard_normal((5, 11, chain.rods + 1, dimension))
    many = [
        chain.accelerations(along=along, rates=rates, forces=forces, refinements=r, threads=threads)
        for r in (0, 1)
        for threads in (1, 2, 3, None)
    ]
    for found in many[1:4]:
        assert found.accelerations.tobytes() == many[0].accelerations.tobytes()
    for found, r in ((many[0], 0), (many[4], 1), (many[7], 1)):
        for i in np.ndindex(5, 11):
            one = chain.accelerations(along=along[i], rates=rates[i], forces=forces[i], refinements=r)
            for name in ("accelerations", "multipliers", "tensions", "reaction", "cancellation"):
                assert getattr(one, name).tobytes() == getattr(found, name)[i].tobytes()


def test_a_chain_is_the_tree_that_has_no_branch():
    chain, along, rates, forces = random_chain(2, 3, 9, tree=False, pinned=True)
    kernels = shipped_module("chain_spatial")
    ends, found = np.zeros((9, 3)), []
    rods = np.stack([chain.masses, chain.lengths, chain.centres, chain.inertias], axis=1)
    kernels.ends(9, rods.reshape(-1), ends.reshape(-1))
    inner, coupling, outer = ends.T.copy()
    mass = chain.point_masses + np.append(inner, 0.0) + np.append(0.0, outer)
    for parents in (None, np.arange(9)):
        a, lam, reaction = np.zeros(30), np.zeros(9), np.zeros(3)
        arrays = (coupling, mass, forces.reshape(-1), along.reshape(-1), rates.reshape(-1))
        kernels.accelerations(9, parents, True, *arrays, a, lam, reaction, np.zeros(kernels.work_size(9)))
        found.append(np.concatenate([a, lam, reaction]))
    assert np.array_equal(*found)
    gamma = -np.sum(rates**2, axis=1)
    kernels.solve(9, None, True, *arrays[:4], gamma, a, lam, reaction, np.zeros(kernels.work_size(9)), 0)
    assert np.allclose(found[0], np.concatenate([a, lam, reaction]), rtol=1e-13)


def test_far_from_the_origin_rod_vectors_keep_all_digits():
    chain, along, rates, _ = random_chain(2, 2, 6, tree=False, pinned=True)
    near = chain.accelerations(along=along, rates=rates, refinements=2)
    assert errors(chain, near, along, rates) <= 2e-15
    points = np.concatenate([np.zeros((1, 2)), np.cumsum(along, axis=0)]) + 1e6
    speeds = np.concatenate([np.zeros((1, 2)), np.cumsum(rates, axis=0)])
    far = chain.accelerations(points, speeds)
    own = errors(chain, far, points[1:] - points[:-1], speeds[1:] - speeds[:-1])
    assert own <= 1e-12, "exact for the positions as given"


def test_energy_against_the_centres_of_mass():
    chain, along, rates, _ = random_chain(6, 2, 5, tree=False, pinned=True)
    p, v = (np.concatenate([np.zeros((1, 2)), np.cumsum(x, axis=0)]) for x in (along, rates))
    ratio = (chain.centres / chain.lengths)[:, None]
    centre, speed = p[:-1] + ratio * along, v[:-1] + ratio * rates
    spin = (along[:, 0] * rates[:, 1] - along[:, 1] * rates[:, 0]) / chain.lengths**2
    kinetic = np.sum(chain.masses * np.sum(speed**2, 1) + chain.inertias * spin**2) / 2
    kinetic += np.sum(chain.point_masses * np.sum(v**2, 1)) / 2
    potential = -np.sum(chain.masses[:, None] * centre * chain.gravity)
    potential -= np.sum(chain.point_masses[:, None] * p * chain.gravity)
    assert chain.kinetic_energy(v) == pytest.approx(kinetic, rel=1e-13)
    assert chain.potential_energy(p) == pytest.approx(potential, rel=1e-13)
    assert chain.kinetic_energy(np.stack([v, 2 * v])) == pytest.approx([kinetic, 4 * kinetic], rel=1e-13)


def test_whip():
    """Folded chain of 1 m and 1 kg, tip released: a peak of 15.7056 m/s at 0.3799 s."""
    l = 1 / 25
    points = [(0, -k * l) for k in range(13)] + [(l, (k - 12) * l) for k in range(13)]
    chain = symgen.Chain(np.full(25, l), np.full(25, l))
    run = chain.simulate(0.385, points, step=2e-4, samples=1926)
    speed = np.linalg.norm(run.velocities[:, -1], axis=1)
    assert speed.max() == pytest.approx(15.7056, abs=2e-3)
    assert run.times[speed.argmax()] == pytest.approx(0.3799, abs=2e-4)
    assert run.length_drift < 1e-14
    assert np.ptp(run.energy) < 1e-4


def test_runs_converge_with_the_fourth_order_and_side_by_side():
    chain = symgen.Chain([0.8, 0.5], [1.2, 0.7], parents=[0, 1])
    start = np.array([[(0, 0), (0.8, 0), (0.8, 0.5)], [(0, 0), (0, 0.8), (0.5, 0.8)]])
    ends = [
        chain.simulate(0.5, start, method="rk4", step=h, samples=2).positions[-1]
        for h in (1 / 100, 1 / 200, 1 / 1600)
    ]
    ratio = np.abs(ends[0] - ends[2]).max() / np.abs(ends[1] - ends[2]).max()
    assert 12 < ratio < 20
    alone = chain.simulate(0.5, start[1], method="rk4", step=1 / 100, samples=2)
    assert np.allclose(alone.positions[-1], ends[0][1], rtol=0, atol=1e-14)
    assert alone.times.tolist() == [0.0, 0.5]


def test_a_free_chain_keeps_its_momentum():
    chain = symgen.Chain([1, 1, 1], [1, 2, 3], pinned=False, gravity=(0, 0, 0), parents=[0, 0, 1])
    along, rates = random_state(np.random.default_rng(1), chain)
    p, v = np.zeros((2, 4, 3))
    for k, inner in enumerate(chain.parents):
        p[k + 1], v[k + 1] = p[inner] + along[k], v[inner] + rates[k]
    run = chain.simulate(1.0, p, v, step=5e-3)
    momentum = [
        sum(
            m * (x[i] + x[k + 1]) / 2
            for k, (i, m) in enumerate(zip(chain.parents, chain.masses, strict=True))
        )
        for x in run.velocities
    ]
    assert np.ptp(momentum, axis=0).max() < 1e-12
    assert np.ptp(run.energy) < 1e-6 * run.energy[0]


def test_a_step_too_large_ends_the_run():
    chain = symgen.Chain(np.full(10, 0.01), np.ones(10))
    with pytest.raises(SimulationError, match="take a smaller step"):
        chain.simulate(10, np.outer(np.arange(11), (0.01, 0)), step=0.5)


@pytest.mark.parametrize(
    "arguments, options, message",
    [
        (([], []), {}, "one rod or more"),
        (([1, 0], [1, 1]), {}, r"lengths\[1\] is 0 m, expected more than zero"),
        (([1, -2], [1, 1]), {}, r"lengths\[1\] is -2"),
        (([1, np.nan], [1, 1]), {}, r"lengths\[1\] is nan m, expected finite"),
        (([1, 1], [1, -1]), {}, r"masses\[1\] is -1 kg, expected zero or more"),
        (([1, 1], [1, 1, 1]), {}, "masses: expected 2 numbers"),
        (([1, "x"], [1, 1]), {}, "expected numbers for lengths, got"),
        (([1, 1], [1, 0]), {}, "outer end of rod 1 carries no mass"),
        (([1, 1], [1, 1]), {"centres": [0.5, 0], "inertias": [0.1, 0]}, "outer end of rod 1 carries no mass"),
        (([1, 1], [1, 1]), {"inertias": [1, -1]}, r"inertias\[1\] is -1"),
        (([1, 1], [1, 1]), {"gravity": (0, 0, 0, 1)}, "2 components in the plane or 3 in space"),
        (([1, 1], [1, 1]), {"parents": [0, 2]}, r"parents\[1\] is 2, expected a point from 0 to 1"),
        (([1, 1], [1, 1]), {"parents": [0.5, 1]}, "2 whole numbers"),
        (([1, 1], [1, 1]), {"point_masses": [1, 1]}, "point_masses: expected 3 numbers"),
    ],
)
def test_wrong_chains_are_refused(arguments, options, message):
    with pytest.raises(ModelError, match=message):
        symgen.Chain(*arguments, **options)


@pytest.mark.parametrize(
    "state, message",
    [
        ({"positions": [(0, 0), (1, 0)]}, r"positions have shape \(2, 2\), expected \(3, 2\)"),
        ({"positions": [(0, 0), (1, 0), (np.inf, 0)]}, r"positions\[2, 0\] is not finite"),
        ({}, "either positions of the points or along of the rods"),
        ({"along": np.ones((2, 2)), "rates": np.ones((4, 2, 2))}, "differ in shape"),
        ({"along": np.ones((2, 2)), "forces": np.ones((2, 2))}, "forces have shape"),
        ({"along": np.ones((2, 2)), "base": (1, 2, 3)}, "base: expected 2 numbers"),
    ],
)
def test_wrong_states_are_refused(state, message):
    with pytest.raises(ModelError, match=message):
        symgen.Chain([1, 1], [1, 1]).accelerations(**state)


def test_an_undetermined_motion_is_named():
    chain = symgen.Chain([1, 1, 1], [1, 0, 0], point_masses=[0, 0, 0, 2])
    with pytest.raises(ModelError, match="motion of the outer point of rod 1"):
        chain.accelerations(along=[(1, 0), (1, 0), (0, 1)])


def test_starts_off_their_lengths_are_refused():
    with pytest.raises(ModelError, match="rod 0 is off its length"):
        symgen.Chain([1], [1]).simulate(1, [(0, 0), (2, 0)])


def test_the_kernels_count_at_most_what_was_promised():
    assert shipped_module("chain").FLOPS <= 90
    assert shipped_module("chain_spatial").FLOPS <= 180


def test_kernels_refuse_short_arrays_and_wrong_parents():
    kernels = shipped_module("chain")
    arrays = [np.ones(k) for k in (2, 3, 6, 4, 4, 6, 2, 2, kernels.work_size(2))]
    kernels.accelerations(2, None, True, *arrays)
    with pytest.raises(ValueError, match="force has 5 entries, expected 6"):
        kernels.accelerations(2, None, True, *arrays[:2], np.ones(5), *arrays[3:])
    with pytest.raises(ValueError, match=r"parent\[0\] is 1, expected a point from 0 to 0"):
        kernels.accelerations(2, np.array([1, 1]), True, *arrays)


def folded(rods=6):
    """Return a chain with a heavy tip, folded, and its points."""
    chain = symgen.Chain(np.full(rods, 0.2), np.full(rods, 0.3), point_masses=[0.0] * rods + [0.5])
    return chain, np.array([(0.1 * k, 0.2 * sqrt(0.75) * (k % 2)) for k in range(rods + 1)])


def test_every_explicit_method_finds_the_same_motion():
    chain, points = folded()
    fine = chain.simulate(0.5, points, rtol=1e-12)
    assert fine.times == pytest.approx(np.linspace(0, 0.5, 201)) and np.ptp(fine.energy) < 1e-10
    for options in ({}, {"method": "dopri5"}, {"step": 2e-4}, {"method": "rattle", "step": 1e-4}):
        found = chain.simulate(0.5, points, t_eval=[0.1, 0.4], **options)
        tolerance = 1e-4 if options.get("method") == "rattle" else 1e-7
        np.testing.assert_allclose(found.positions, fine.positions[[40, 160]], rtol=0, atol=tolerance)
        assert found.length_drift < 1e-15
    with pytest.raises(ModelError, match="radau5 is implicit and needs derivatives of the forces"):
        chain.simulate(0.5, points, method="radau5")


@pytest.mark.parametrize("batch", [(), (11,)])
def test_weight_may_be_a_function_of_the_state(batch):
    """Weights as forces, a function in one chain and numbers in another, and drag that no chain has."""
    chain, points = folded()
    start = np.broadcast_to(points, (*batch, *points.shape))
    light = symgen.Chain(chain.lengths, chain.masses, point_masses=chain.point_masses, gravity=(0, 0))
    halves = np.r_[chain.masses, 0.0] / 2 + np.r_[0.0, chain.masses] / 2 + chain.point_masses
    weight = halves[:, None] * (0, -9.81)
    given = chain.simulate(0.3, start, samples=3)
    for forces in (weight, lambda t, p, v: weight + 0.0 * v):
        found = light.simulate(0.3, start, forces=forces, samples=3)
        np.testing.assert_allclose(found.positions, given.positions, rtol=0, atol=1e-9)
    dragged = chain.simulate(0.3, start, forces=lambda t, p, v: -0.5 * v, samples=31)
    power = 0.5 * np.sum(dragged.velocities**2, axis=(-2, -1))
    lost = np.trapezoid(power, dragged.times, axis=0)
    np.testing.assert_allclose(dragged.energy[0] - dragged.energy[-1], lost, rtol=2e-3)


def test_errors_of_forces_reach_the_caller():
    chain, points = folded()

    def forces(t, p, v):
        if t > 0.1:
            raise ZeroDivisionError("far enough")
        return np.zeros_like(p)

    with pytest.raises(ZeroDivisionError, match="far enough"):
        chain.simulate(0.3, points, forces=forces)
    with pytest.raises(ModelError, match=r"forces have shape \(3, 2\)"):
        chain.simulate(0.3, points, forces=lambda t, p, v: np.zeros((3, 2)))
    with pytest.raises(ModelError, match=r"forces returned None, expected the forces on all points \[N\]"):
        chain.simulate(0.3, points, forces=lambda t, p, v: None)
    with pytest.raises(ModelError, match="forces: expected numbers"):
        chain.simulate(0.3, points, forces=lambda t, p, v: 1j * p)


@pytest.mark.parametrize("function_first", [True, False])
def test_runs_with_a_function_for_forces_are_resumed_with_one(tmp_path, function_first):
    chain, points = folded()
    file = tmp_path / "chain.npz"
    given = [lambda t, p, v: t * np.ones_like(p), None][:: 1 if function_first else -1]

    def stop(part):
        if part > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        chain.simulate(
            0.1, points, step=1e-3, forces=given[0], checkpoint=file, checkpoint_every=0, progress=stop
        )
    with pytest.raises(ResultError, match="checkpoint of another run"):
        chain.simulate(0.1, points, step=1e-3, forces=given[1], resume=file)
    chain.simulate(0.1, points, step=1e-3, forces=given[0], resume=file)


@pytest.mark.parametrize("batch", [(), (3,)])
def test_a_resumed_run_has_the_same_bits(tmp_path, batch):
    chain, points = folded()
    start = np.broadcast_to(points, (*batch, *points.shape))
    file = tmp_path / "chain.npz"
    whole = chain.simulate(0.5, start, step=1e-3)

    def stop(part):
        if part > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        chain.simulate(0.5, start, step=1e-3, checkpoint=file, checkpoint_every=0, progress=stop)
    again = chain.simulate(0.5, start, step=1e-3, resume=file)
    for name in ("times", "positions", "velocities", "energy"):
        assert getattr(again, name).tobytes() == getattr(whole, name).tobytes()
    with pytest.raises(ResultError, match="checkpoint of another run"):
        chain.simulate(0.5, start, step=1e-3, resume=file, forces=np.ones_like(points))


def test_a_start_that_nothing_determines_is_refused():
    chain = symgen.Chain([1, 1, 1], [1, 0, 0], point_masses=[0, 0, 0, 2])
    with pytest.raises(ModelError, match="motion of the outer point of rod 1"):
        chain.simulate(1.0, [(0, 0), (1, 0), (2, 0), (2, 1)])
