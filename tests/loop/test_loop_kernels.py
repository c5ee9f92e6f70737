"""Every kernel of hand-made loops at random states: against 40 digits, and against 4x4 matrices."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from shared.loop_reference import DIGITS, Reference, inverse, rotation, vee
from shared.loops import LOOPS, real
from shared.oracle import Oracle, relative_error

from symgen.codegen.emit import emit
from symgen.codegen.target import Target
from symgen.lowering.program import lower_system
from symgen.models.loop.derivation import LoopDerivation
from symgen.models.loop.system import loop_system

TOLERANCE = 1e-13
#: Of numerical differentiation in 40 digits.
EXACT = 1e-15


def random_values(loop, system, seed):
    rng = np.random.default_rng(seed)
    values = {g.name: rng.uniform(-1.5, 1.5, len(g.quantities)) for g in system.groups}
    values["p"] = np.array([float(p.default) for p in loop.parameters]) * rng.uniform(
        0.7, 1.4, len(loop.parameters)
    )
    return values


def everything(make):
    """A loop with every output that it has."""
    loop = make()
    model = LoopDerivation(loop)
    names = [f"{v.name}{w}" for v in model.variables for w in ("", ".rate", ".acceleration", ".drive")]
    words = ("position", "velocity", "acceleration", "angular_velocity", "angular_acceleration", "centre")
    names += [f"{k}.{w}" for k in model.links for w in words]
    ground = loop.rows[-1].link
    chain = [ground, *model.links, ground]
    names += [
        f"{chain[j]}.joint{k}.{w}"
        for k in range(1, len(chain))
        for j in (k - 1, k)
        for w in ("force", "moment")
    ]
    return make(outputs=[*dict.fromkeys(names), "kinetic_energy", "potential_energy", "energy", "power"])


@pytest.fixture(scope="module", params=LOOPS)
def case(request):
    loop = everything(LOOPS[request.param])
    system = loop_system(loop)
    values = random_values(loop, system, 11)
    model = LoopDerivation(loop)
    with mp.workdps(DIGITS):
        reference = Reference(loop, values, model.paths.meet, model.paths.ends)
    return loop, system, values, Oracle(system), reference


def test_kernels_against_30_digits(case):
    loop, system, _, oracle, _ = case
    program = lower_system(system)
    (source,) = emit(program, Target("numpy"), "x")
    kernels = {}
    exec(source.text, kernels)
    for seed in (1, 2):
        values = random_values(loop, system, seed)
        taken = [values[a] for a in ("t", "q", "u", "p", "work")]
        if program.setup:
            taken[3] = np.append(values["p"], np.zeros(program.setup.out_size))
            kernels["setup"](None, None, None, taken[3], None, taken[3][len(values["p"]) :])
        for export in system.exports:
            sizes = [int(np.prod(system[name].matrix.shape)) for name in export.matrices]
            found = np.zeros(sum(sizes))
            kernels[export.kernel](*taken, found)
            for name, part in zip(export.matrices, np.split(found, np.cumsum(sizes)[:-1]), strict=True):
                assert relative_error(part, oracle.matrix(name, values)) < TOLERANCE, (export.kernel, name)


def close(found, expected, what=""):
    with mp.workdps(DIGITS):
        expected = list(expected)
        size = max(1, *(abs(x) for x in expected))
        worst = max(abs(a - b) for a, b in zip(found, expected, strict=True)) / size
        assert worst < EXACT, (what, float(worst))


def test_closure_and_its_derivative(case):
    loop, _, values, oracle, reference = case
    with mp.workdps(DIGITS):

        def whole(q):
            found = mp.eye(4)
            for row in reference.rows_at(q):
                found = found * row
            return found

        b = whole(reference.q)
        close(oracle.matrix("closure_defect", values), (b - mp.eye(4))[:3, :], "defect")
        jacobian = oracle.matrix("closure_jacobian", values)
        h = mp.mpf(10) ** -12
        for j in range(len(loop.variables)):
            ahead, behind = ([q + (d if i == j else 0) for i, q in enumerate(reference.q)] for d in (h, -h))
            moving = (whole(ahead) - whole(behind)) / (2 * h) * inverse(b)
            close(jacobian[:, j], [*vee(moving[:3, :3]), *moving[:3, 3]], loop.variables[j].name)


def test_operators_of_the_paper_are_the_screws(case):
    """Eqs. (12)-(17) of every variable: H = M Q M^T is the cross-product matrix of its screw."""
    loop, _, values, oracle, _ = case
    with mp.workdps(DIGITS):
        jacobian = oracle.matrix("closure_jacobian", values)
        for j, v in enumerate(loop.variables):
            h = oracle.matrix(f"{v.name}_operator", values)
            for part, rows in ((h[:, :3], jacobian[:3, j]), (h[:, 3:], jacobian[3:, j])):
                close([*vee(part)], rows, v.name)
                close([*(part + part.T)], [0] * 9, v.name)


def test_screws_have_the_rates_that_are_given(case):
    loop, system, values, oracle, reference = case
    count = len(loop.variables)
    symbols = [x.symbol for g in system.groups for x in g.quantities]
    function = sp.lambdify(symbols, sp.Matrix(system.expanded("screws")), "mpmath")
    with mp.workdps(DIGITS):
        h = mp.mpf(10) ** -12

        def screws(s):
            moved = [mp.mpf(float(x)) for g in system.groups for x in values[g.name]]
            at = len(values["t"])
            moved[at : at + count] = reference.at(s)
            return mp.matrix(function(*moved))

        rates = (screws(h) - screws(-h)) / (2 * h)
        close(oracle.matrix("screw_rates", values), rates, "rates")
        close(oracle.matrix("screw_drift", values), rates * mp.matrix(reference.u), "drift")


def test_motion_of_links(case):
    loop, _, values, oracle, reference = case
    with mp.workdps(DIGITS):
        for k, row in enumerate(loop.rows[:-1], 1):

            def place(s, k=k):
                return reference.pose(k, s)[:3, 3]

            def turning(s, k=k):
                return reference.angular_velocity(k, s)

            expected = {
                "position": place(0),
                "velocity": reference.rate(place),
                "acceleration": reference.rate(place, 2),
                "angular_velocity": turning(0),
                "angular_acceleration": reference.rate(turning),
                "centre": reference.centre(k),
            }
            for word, value in expected.items():
                close(oracle.matrix(f"{row.link}.{word}", values), value, f"{row.link}.{word}")


def test_forces(case):
    loop, _, values, oracle, reference = case
    count = len(loop.variables)
    with mp.workdps(DIGITS):
        given = [mp.mpf(float(x)) for x in values["work"][count:]]
        closing = mp.matrix(given[:3]), mp.matrix(given[3:])
        own, whole = reference.efforts(), reference.efforts(closing)
        close(oracle.matrix("inverse_efforts", values), own, "inverse")
        links = [loop.rows[-1].link, *(row.link for row in loop.rows)]
        for joint in range(1, len(loop.rows) + 1):
            for part, wrench in zip(("force", "moment"), reference.joint_wrench(joint, closing), strict=True):
                for side, sign in ((joint - 1, -1), (joint, 1)):
                    name = f"{links[side]}.joint{joint}.{part}"
                    close(oracle.matrix(name, values), sign * wrench, name)
        power = mp.mpf(0)
        for j, v in enumerate(loop.variables):
            close(oracle.matrix(f"{v.name}.drive", values), [whole[j]], v.name)
            effort = whole[j] if v.effort is None else reference.number(v.effort)
            known = mp.mpf(0) if v.effort is None else effort
            close([oracle.matrix("given_efforts", values)[j]], [known], "given")
            power += effort * reference.u[j]
        for load in loop.loads:
            pose, rate = (
                reference.pose(load.row + 1),
                reference.rate(lambda s, k=load.row + 1: reference.pose(k, s)),
            )
            force, couple = reference.vector(load.force), reference.vector(load.torque)
            if not load.in_ground:
                force, couple = rotation(pose) * force, rotation(pose) * couple
            point = rate[:3, 3] + rate[:3, :3] * reference.vector(load.at)
            turning = vee(rate[:3, :3] * rotation(pose).T)
            power += (force.T * point)[0] + (couple.T * turning)[0]
        close(oracle.matrix("power", values), [power], "power")


def test_energies(case):
    loop, _, values, oracle, reference = case
    with mp.workdps(DIGITS):
        kinetic, potential = mp.mpf(0), mp.mpf(0)
        for k in range(1, len(loop.rows)):
            mass = reference.number(loop.body(k - 1).mass)
            velocity = reference.rate(lambda s, k=k: reference.centre(k, s))
            kinetic += (velocity.T * velocity)[0] * mass / 2
            kinetic += (reference.spin(k).T * reference.angular_velocity(k))[0] / 2
            potential -= mass * (reference.vector(loop.gravity).T * reference.centre(k))[0]
        close(oracle.matrix("kinetic_energy", values), [kinetic], "kinetic")
        close(oracle.matrix("potential_energy", values), [potential], "potential")
        close(oracle.matrix("energy", values), [kinetic + potential], "energy")


def test_inputs_and_table(case):
    loop, _, values, oracle, reference = case
    with mp.workdps(DIGITS):
        table = [x for row in reference.table(*reference.q) for x in row]
        close(oracle.matrix("rows", values), table, "rows")
        inputs = loop.having("input")
        if inputs:
            found = oracle.matrix("inputs", values)
            for i, v in enumerate(inputs):
                motion = v.motion.xreplace(reference.parameters())
                function = sp.lambdify(real("t"), motion, "mpmath")
                t = mp.mpf(float(values["t"][0]))
                close(found[i, :], [mp.diff(function, t, n, h=mp.mpf(10) ** -10) for n in (0, 1, 2)], v.name)


def test_mass_matrix_is_the_derivative_of_the_efforts():
    loop = LOOPS["hooke_loop"]()
    system = loop_system(loop)
    oracle, values = Oracle(system), random_values(loop, system, 3)
    found = oracle.matrix("mass_matrix", values)
    count = len(loop.variables)
    values["work"][:count] = 0
    with mp.workdps(30):
        still = oracle.matrix("inverse_efforts", values)
        for j in range(count):
            moved = {**values, "work": values["work"].copy()}
            moved["work"][j] = 1.0
            close(found[:, j], oracle.matrix("inverse_efforts", moved) - still, loop.variables[j].name)
