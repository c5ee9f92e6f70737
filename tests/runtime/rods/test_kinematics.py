"""Kinematic analysis against closed forms: poses, rates, dead centres, bifurcations, assemblies."""

from __future__ import annotations

import numpy as np
import pytest
from shared.linkages import GRAVITY, at, chain, circles, four_bar, ground, rod

import symgen
from symgen.errors import CapabilityError, ModelError, SceneError, SimulationError
from symgen.runtime.rods import kinematics

A, B, C, D = 0.1, 0.35, 0.3, 0.4


def crank_rocker_by_angles(theta):
    """Angles of coupler and rocker by Freudenstein's equation, their rates and second rates by its derivative."""
    # Freudenstein: k1 cos(psi) - k2 cos(theta) + k3 = cos(theta - psi), with the rocker's angle psi.
    k1, k2, k3 = D / A, D / C, (A**2 - B**2 + C**2 + D**2) / (2 * A * C)
    p, q, r = np.sin(theta), np.cos(theta) - k1, k3 - k2 * np.cos(theta)
    # p sin(psi) + q cos(psi) = r
    psi = np.arctan2(p, q) - np.arccos(r / np.hypot(p, q))
    phi = np.arctan2(C * np.sin(psi) - A * np.sin(theta), D + C * np.cos(psi) - A * np.cos(theta))
    return phi, np.unwrap(psi)


def test_crank_rocker_over_a_full_turn():
    w = 2 * np.pi
    motion = symgen.build("crank_rocker").kinematics(0.0, 1.0, samples=361)
    theta = w * motion.time
    assert len(theta) == 361 and not motion.singular_poses and not motion.unassemblable
    phi, psi = crank_rocker_by_angles(theta)
    assert motion["rocker.angle"].values == pytest.approx(
        psi - 2 * np.pi * np.round((psi - motion["rocker.angle"].values) / 2 / np.pi), abs=1e-13
    )
    # Loop closure differentiated: A e^(i theta) + B e^(i phi) = D + C e^(i psi).
    psi_rate = A * w * np.sin(phi - theta) / (C * np.sin(phi - psi))
    phi_rate = A * w * np.sin(psi - theta) / (B * np.sin(phi - psi))
    assert motion["rocker.rate"].values == pytest.approx(psi_rate, abs=1e-12 * w)
    assert motion["coupler.rate"].values == pytest.approx(phi_rate, abs=1e-12 * w)
    bend = A * w**2 * np.cos(phi - theta) + B * phi_rate**2 - C * psi_rate**2 * np.cos(phi - psi)
    second = bend / (C * np.sin(psi - phi))
    assert motion["rocker.acceleration"].values == pytest.approx(second, abs=1e-11 * w**2)
    b = np.array([D + C * np.cos(psi), C * np.sin(psi)]).T
    assert motion["B.position"].values == pytest.approx(b, abs=1e-15)
    e, n = np.array([np.cos(psi), np.sin(psi)]).T, np.array([-np.sin(psi), np.cos(psi)]).T
    assert motion["B.velocity"].values == pytest.approx(C * psi_rate[:, None] * n, abs=1e-12)
    exact = C * (second[:, None] * n - (psi_rate**2)[:, None] * e)
    assert motion["B.acceleration"].values == pytest.approx(exact, abs=1e-10)
    assert motion["crank.angle"].values == pytest.approx(theta, abs=1e-14)


def slider_crank(drivers, r=0.05, l=0.2, **more):
    points = {"O": ground(0, 0), "A": at(0, r), "B": at(np.sqrt(l**2 - r**2), 0), "E": ground(0.4, 0)}
    links = {"crank": rod("O", "A"), "rod": rod("A", "B"), "rail": {"points": ["O", "E"]}, **more}
    return symgen.Scene(
        parameters={"w": "1 rad/s", "v": "1 m/s", "l0": f"{float(np.sqrt(l**2 - r**2))!r} m"},
        points=points,
        links=links,
        guides=[{"points": ["B"], "along": "rail"}],
        drivers=drivers,
    )


def test_slider_crank_driven_by_its_crank():
    r, l = 0.05, 0.2
    motion = symgen.build(slider_crank([{"link": "crank", "angle": "pi/2 + w*t"}])).kinematics(
        0, 6.2, of=["B"]
    )
    theta = np.pi / 2 + motion.time
    root = np.sqrt(l**2 - (r * np.sin(theta)) ** 2)
    assert motion["B.position"].values[:, 0] == pytest.approx(r * np.cos(theta) + root, abs=1e-15)
    speed = -r * np.sin(theta) - r**2 * np.sin(theta) * np.cos(theta) / root
    assert motion["B.velocity"].values[:, 0] == pytest.approx(speed, abs=1e-14)
    second = (
        -r * np.cos(theta) - r**2 * np.cos(2 * theta) / root - (r**2 * np.sin(2 * theta) / 2) ** 2 / root**3
    )
    assert motion["B.acceleration"].values[:, 0] == pytest.approx(second, abs=1e-13)
    assert [v.name for v in motion.variables] == ["crank.angle", "B.position", "B.velocity", "B.acceleration"]


def test_slider_crank_driven_by_its_slider_stops_at_both_ends_of_the_stroke():
    r, l = 0.05, 0.2
    actuator = {"points": ["O", "B"], "mass": "0 kg", "length": "l0 + v*t"}
    model = symgen.build(slider_crank([], actuator=actuator))
    begin = np.sqrt(l**2 - r**2)
    motion = model.kinematics(-0.1, 0.1)
    ends = sorted(p.drives["actuator.length"] for p in motion.dead_centres)
    assert ends == pytest.approx([l - r, l + r], abs=1e-12)
    assert all(("crank", "rod") in p.collinear for p in motion.dead_centres)
    low, high = motion.unassemblable
    assert low == pytest.approx((-0.1, l - r - begin), abs=1e-12)
    assert high == pytest.approx((l + r - begin, 0.1), abs=1e-12)
    assert motion.time.min() > low[1] and motion.time.max() < high[0]
    whole = model.kinematics(-0.1, 0.1, through=True, of=["A", "B"])
    # Through both dead centres the curve closes: A goes once round its circle.
    a = whole["A.position"].values
    assert a[:, 1].min() < -0.9 * r and a[:, 1].max() > 0.9 * r
    assert len(whole.dead_centres) == 2
    assert np.hypot(*a.T) == pytest.approx(np.full(len(a), r), abs=1e-15)


NON_GRASHOF = (0.5, 0.4, 0.45, 0.6)


def test_a_crank_that_cannot_turn_round():
    a, b, c, d = NON_GRASHOF
    limit = np.arccos((a**2 + d**2 - (b + c) ** 2) / (2 * a * d))
    model = symgen.build(four_bar(*NON_GRASHOF, 0.3))
    motion = model.kinematics(0, 2 * np.pi - 0.3, samples=181)
    reached, beyond = motion.dead_centres
    assert reached.drives["crank.angle"] == pytest.approx(limit, abs=1e-12)
    assert reached.collinear == (("coupler", "rocker"),)
    tip = np.array([a * np.cos(limit), a * np.sin(limit)])
    exact = tip + (np.array([d, 0]) - tip) * b / (b + c)
    assert reached.positions["B"] == pytest.approx(exact, abs=1e-12)
    assert beyond.drives["crank.angle"] == pytest.approx(2 * np.pi - limit, abs=1e-12)
    assert motion.unassemblable == (pytest.approx((limit - 0.3, 2 * np.pi - limit - 0.3), abs=1e-12),)
    assert motion.out_of_reach == (pytest.approx((2 * np.pi - limit - 0.3, 2 * np.pi - 0.3), abs=1e-12),)
    assert motion.time.max() < limit - 0.3
    assert "cannot" not in reached.describe() and "coupler and rocker in line" in reached.describe()
    with pytest.raises(ModelError, match="crank.torque(.|\\n)*inverse-dynamics has forces and torques"):
        model.kinematics(0, 0.1, of=["crank.torque"])
    assert f"crank.angle = {limit:.9g} rad:" in reached.describe()
    said = reached.describe({"rad": ("deg", np.pi / 180)})
    assert f"crank.angle = {np.degrees(limit):.9g} deg:" in said


def test_a_start_next_to_a_dead_centre_is_no_reason_for_short_steps(monkeypatch):
    """Points are as fast as one likes there, and the drive is not."""
    monkeypatch.setattr(kinematics, "MOST_STEPS", 2000)
    a, b, c, d = NON_GRASHOF
    limit = float(np.arccos((a**2 + d**2 - (b + c) ** 2) / (2 * a * d)))
    motion = symgen.build(four_bar(*NON_GRASHOF, limit - 1e-9)).kinematics(0, 6.0, samples=11)
    end, beyond = 1e-9, 2 * np.pi - 2 * limit + 1e-9
    assert motion.unassemblable == (pytest.approx((end, beyond), abs=1e-12),)
    assert motion.out_of_reach == (pytest.approx((beyond, 6.0), abs=1e-12),)


def test_the_other_branch_is_reached_by_choice_or_through_the_dead_centre():
    a, b, c, d = NON_GRASHOF
    model = symgen.build(four_bar(*NON_GRASHOF, 0.3))
    drawn, other = model.assemblies()
    tip = np.array([a * np.cos(0.3), a * np.sin(0.3)])
    assert drawn.positions["B"] == pytest.approx(circles(tip, [d, 0], b, c), abs=1e-14)
    assert other.positions["B"] == pytest.approx(circles(tip, [d, 0], b, c, -1.0), abs=1e-14)
    chosen = model.kinematics(0, 1, samples=11, of=["B"], state=other)
    theta = 0.3 + chosen.time
    tips = np.array([a * np.cos(theta), a * np.sin(theta)]).T
    expected = circles(tips, np.tile([d, 0.0], (11, 1)), b, c, -1.0)
    assert chosen["B.position"].values == pytest.approx(expected, abs=1e-14)
    through = model.kinematics(0, 2, samples=21, of=["B"], through=True)
    turn = int(np.argmax(through.time))
    assert np.all(np.diff(through.time[: turn + 1]) > 0) and np.all(np.diff(through.time[turn + 1 :]) < 0)
    back = through["B.position"].values[through.time == 1.0]
    assert back[0] != pytest.approx(back[1], abs=1e-2)
    assert back[1] == pytest.approx(chosen["B.position"].values[-1], abs=1e-14)


def test_parallelogram_names_its_bifurcations_and_keeps_its_branch():
    model = symgen.build(four_bar(0.3, 0.6, 0.3, 0.6, 0.7))
    motion = model.kinematics(-0.7, 2 * np.pi - 0.7, samples=361)
    assert not motion.dead_centres
    angles = [p.drives["crank.angle"] for p in motion.bifurcations]
    assert angles == pytest.approx([0.0, np.pi, 2 * np.pi], abs=1e-7)
    assert motion.bifurcations[1].collinear == (("crank", "coupler"), ("coupler", "rocker"))
    theta = 0.7 + motion.time
    b = np.array([0.6 + 0.3 * np.cos(theta), 0.3 * np.sin(theta)]).T
    assert len(theta) == 361  # those on the collinear poses themselves included
    assert motion["B.position"].values == pytest.approx(b, abs=1e-8)
    assert motion["B.velocity"].values == pytest.approx(
        0.3 * np.array([-np.sin(theta), np.cos(theta)]).T, abs=1e-8
    )
    assert motion["B.acceleration"].values == pytest.approx([0.6, 0] - b, abs=1e-8)


def test_peaucellier_draws_a_straight_line():
    scene = symgen.load_scene("peaucellier").model_dump(exclude_unset=True)
    scene["parameters"]["w"] = "1 rad/s"
    scene["drivers"] = [{"link": "OA", "angle": "pi + w*t"}]
    model = symgen.build(symgen.Scene(**scene))
    motion = model.kinematics(-0.6, 0.6, of=["C"])
    # C lies opposite A as seen from E, and EA*EC = 16 cm^2.
    theta = np.pi + motion.time
    a = 0.02 * np.array([np.cos(theta), np.sin(theta)]).T - [0.02, 0]
    c = [0.02, 0] - 16e-4 * a / np.sum(a * a, axis=1)[:, None]
    assert motion["C.position"].values == pytest.approx(c, abs=1e-15)
    assert motion["C.position"].values[:, 0] == pytest.approx(np.full(181, 0.06), abs=1e-15)

    # It locks where EA, 4 sin(theta/2) cm, is the difference of its rods, 4 sqrt(2) - 4 cm: rank 7 falls to 5.
    limit = 2 * np.arcsin(np.sqrt(2) - 1)
    for through in (False, True):
        whole = model.kinematics(-np.pi, np.pi, of=["C"], through=through)
        angles = sorted(p.drives["OA.angle"] for p in whole.dead_centres)
        assert angles == pytest.approx([limit, 2 * np.pi - limit], abs=1e-12)
        assert whole.unassemblable == (
            pytest.approx((-np.pi, limit - np.pi), abs=1e-12),
            pytest.approx((np.pi - limit, np.pi), abs=1e-12),
        )


def test_a_spatial_mechanism_and_two_drives():
    """A two-rod arm driven at both joints in the plane; a mass on three pulled ropes in space."""
    points = {"O": ground(0, 0), "A": at(1, 0), "B": at(1, 0.5)}
    arm = symgen.Scene(
        parameters={"w": "1 rad/s"},
        points=points,
        links={"one": rod("O", "A"), "two": rod("A", "B")},
        drivers=[{"link": "one", "angle": "w*t"}, {"link": "two", "angle": "pi/2 - 3*w*t"}],
    )
    motion = symgen.build(arm).kinematics(0, 2, of=["B"])
    t = motion.time
    b = np.array([np.cos(t) + 0.5 * np.sin(3 * t), np.sin(t) + 0.5 * np.cos(3 * t)]).T
    assert motion["B.position"].values == pytest.approx(b, abs=1e-14)
    anchors = {"P": (0, 0, 0), "Q": (1, 0, 0), "R": (0, 1, 0)}
    place = np.array([0.3, 0.4, -0.8])
    lengths = {k: float(np.linalg.norm(place - v)) for k, v in anchors.items()}
    ropes = {
        f"r{k}": {
            "points": [k, "M"],
            "mass": "0 kg",
            "length": f"{v!r}*u" + (" + 0.3*v*t" if k == "P" else ""),
        }
        for k, v in lengths.items()
    }
    scene = symgen.Scene(
        parameters={"u": "1 m", "v": "1 m/s"},
        points={**{k: ground(*v) for k, v in anchors.items()}, "M": at(*place)},
        links=ropes,
        masses=[{"point": "M", "mass": "1 kg"}],
    )
    motion = symgen.build(scene).kinematics(0, 0.5)
    p, q, r = (lengths["P"] + 0.3 * motion.time, lengths["Q"], lengths["R"])
    x, y = (p**2 - q**2 + 1) / 2, (p**2 - r**2 + 1) / 2
    exact = np.array([x, y, -np.sqrt(p**2 - x**2 - y**2)]).T
    assert motion["M.position"].values == pytest.approx(exact, abs=1e-14)
    assert motion["M.velocity"].values[:, 0] == pytest.approx(0.3 * p, abs=1e-14)


def test_a_result_is_saved_plotted_and_read_back(tmp_path):
    motion = symgen.build(four_bar(*NON_GRASHOF, 0.3)).kinematics(0, 3, samples=31)
    for ending in ("nc", "npz"):
        again = symgen.load_result(motion.save(tmp_path / f"m.{ending}"))
        assert again.dead_centres == motion.dead_centres
        assert again.unassemblable == motion.unassemblable
        assert again["B.position"].values.tolist() == motion["B.position"].values.tolist()
    motion.plot("B", file=tmp_path / "m.svg")
    assert "kinematics" in (tmp_path / "m.svg").read_text() or (tmp_path / "m.svg").stat().st_size > 1000


def test_missing_drives_are_counted():
    with pytest.raises(CapabilityError, match=r"four_bar .* needs 1 more drive\b"):
        symgen.build("four_bar").kinematics()
    with pytest.raises(CapabilityError, match=r"triple_pendulum .* needs 3 more drives"):
        symgen.build("triple_pendulum").kinematics()
    scene = chain(
        [(0, 0), (1, 0), (2, 0.5)],
        parameters={"w": "1 rad/s"},
        drivers=[{"link": "L0", "angle": "w*t"}],
    )
    with pytest.raises(CapabilityError, match=r"needs 1 more drive\b"):
        symgen.build(scene).kinematics()


def test_bad_ranges_and_names():
    model = symgen.build("crank_rocker")
    with pytest.raises(ModelError, match="start before stop, got 1 to 0 s"):
        model.kinematics(1.0, 0.0)
    with pytest.raises(ModelError, match="between 2 and 1 million points, got 1"):
        model.kinematics(samples=1)
    with pytest.raises(ModelError, match="Did you mean 'rocker'"):
        model.kinematics(of=["roker"])
    stuck = symgen.build(four_bar(*NON_GRASHOF, 0.3))
    with pytest.raises(SimulationError, match=r"does not get from t = 0 s.*dead centre|does not get"):
        stuck.kinematics(2.0, 3.0)


def test_the_numpy_backend_agrees():
    fast, slow = (
        symgen.build("crank_rocker", backend=b).kinematics(0, 0.2, samples=5) for b in ("c", "numpy")
    )
    assert fast["B.acceleration"].values == pytest.approx(slow["B.acceleration"].values, rel=1e-12)


def test_the_same_numbers_every_time():
    model = symgen.build(four_bar(*NON_GRASHOF, 0.3))
    one, two = (model.kinematics(0, 5.9, samples=41) for _ in range(2))
    assert one.statistics | {"wall_s": 0} == two.statistics | {"wall_s": 0}
    assert one.provenance == two.provenance
    assert all(
        a.values.tolist() == b.values.tolist() for a, b in zip(one.variables, two.variables, strict=True)
    )


def test_gravity_does_not_matter():
    plain = four_bar(*NON_GRASHOF, 0.3)
    heavy = symgen.Scene(**{**plain.model_dump(exclude_unset=True), "gravity": GRAVITY})
    one, two = (symgen.build(s).kinematics(0, 1, samples=5) for s in (plain, heavy))
    assert one["B.acceleration"].values == pytest.approx(two["B.acceleration"].values, rel=1e-12)


def test_transmission_angle_by_the_law_of_cosines():
    """In kinematics, and among the outputs of an inverse analysis and of a run."""
    a, b, c, d = 0.1, 0.35, 0.3, 0.4
    scene = four_bar(a, b, c, d, 0.3).model_dump(exclude_unset=True)
    model = symgen.build(
        symgen.Scene(
            **scene,
            analysis={"t_end": "2 s", "outputs": ["A.B.C.angle", "O.A.B.angle", "A.B.C.transmission_angle"]},
        )
    )

    def expected(time):
        diagonal = a**2 + d**2 - 2 * a * d * np.cos(0.3 + time)
        return np.arccos((b**2 + c**2 - diagonal) / (2 * b * c))

    motion = model.kinematics(0, 6, of=["A.B.C"])
    assert motion["A.B.C.angle"].values == pytest.approx(expected(motion.time), abs=1e-14)
    run = model.simulate()
    assert run["A.B.C.angle"].values == pytest.approx(expected(run.time), abs=1e-9)
    assert run.variable("A.B.C.angle").unit == "rad"
    acute = [np.minimum(expected(x.time), np.pi - expected(x.time)) for x in (motion, run)]
    assert acute[0].max() < expected(motion.time).max()  # some of these angles are obtuse
    assert motion["A.B.C.transmission_angle"].values == pytest.approx(acute[0], abs=1e-14)
    assert run["A.B.C.transmission_angle"].values == pytest.approx(acute[1], abs=1e-9)
    one = model.kinematics(0, 6, of=["A.B.C.transmission_angle", "B.velocity"])
    assert [v.name for v in one.variables][-2:] == ["A.B.C.transmission_angle", "B.velocity"]
    assert np.array_equal(one["A.B.C.transmission_angle"], motion["A.B.C.transmission_angle"])
    both = model.kinematics(
        0, 6, samples=3, of=["B", "B.velocity", "A.B.C.angle", "A.B.C.transmission_angle"]
    )
    names = [v.name for v in both.variables]
    assert len(names) == len(set(names)) and names[-2:] == ["A.B.C.angle", "A.B.C.transmission_angle"]
    for unknown in ("A.B.A", "A.B.C.rate", "B.angle"):
        with pytest.raises(ModelError, match=f"no point or moving link '{unknown}'"):
            model.kinematics(0, 1, of=[unknown])


def test_speed_ratio_of_a_four_bar():
    """Rates of rocker and coupler by the law of sines at their joints, at two speeds of the crank."""
    a, b, c, d = 0.1, 0.35, 0.3, 0.4
    outputs = ["rocker.speed_ratio", "coupler.speed_ratio", "rocker.angle", "coupler.angle", "crank.angle"]
    for speed in (0.7, -3.0):
        scene = four_bar(a, b, c, d, 0.3).model_dump(exclude_unset=True)
        scene["drivers"] = [{"link": "crank", "angle": "0.3 + w*t"}]
        scene["parameters"] = {"w": f"{speed} rad/s"}
        motion = symgen.build(
            symgen.Scene(**scene, analysis={"kind": "kinematics", "t_end": "2 s", "outputs": outputs})
        ).kinematics(0, 2)
        crank, coupler, rocker = (motion[f"{k}.angle"].values for k in ("crank", "coupler", "rocker"))
        ratio = a * np.sin(crank - coupler) / (c * np.sin(rocker - coupler))
        assert motion["rocker.speed_ratio"].values == pytest.approx(ratio, abs=1e-13)
        ratio = a * np.sin(rocker - crank) / (b * np.sin(coupler - rocker))
        assert motion["coupler.speed_ratio"].values == pytest.approx(ratio, abs=1e-13)
        assert motion.variable("rocker.speed_ratio").unit == "1"


def test_speed_ratio_of_a_drive_between_two_links():
    """A motor in the joint of crank and coupler: the rates of both differ by its own."""
    a, b, c, d = 0.1, 0.35, 0.3, 0.4
    scene = four_bar(a, b, c, d, 0.3).model_dump(exclude_unset=True)
    names = ("crank", "coupler", "rocker")
    outputs = [f"{k}.{word}" for k in names for word in ("speed_ratio", "angle")]
    places = {p: np.array([float(str(x).split()[0]) for x in of["at"]]) for p, of in scene["points"].items()}
    directions = [np.arctan2(*(places[j] - places[i])[::-1]) for i, j in ("OA", "AB")]
    scene["drivers"] = [
        {"link": "coupler", "against": "crank", "angle": f"{np.subtract(*directions[::-1])} + w*t"}
    ]
    scene["parameters"] = {"w": "-0.7 rad/s"}
    motion = symgen.build(
        symgen.Scene(**scene, analysis={"kind": "kinematics", "t_end": "0.5 s", "outputs": outputs})
    ).kinematics(0, 0.5)
    crank, coupler, rocker = (motion[f"{k}.angle"].values for k in names)
    by_crank = a * np.sin(rocker - crank) / (b * np.sin(coupler - rocker))
    expected = 1 / (by_crank - 1), by_crank / (by_crank - 1)
    for name, ratio in zip(names, expected, strict=False):
        assert motion[f"{name}.speed_ratio"].values == pytest.approx(ratio, abs=1e-12)
    of_rocker = a * np.sin(crank - coupler) / (c * np.sin(rocker - coupler)) / (by_crank - 1)
    assert motion["rocker.speed_ratio"].values == pytest.approx(of_rocker, abs=1e-12)
    assert "of coupler against crank" in motion.variable("rocker.speed_ratio").about


def test_angular_acceleration_of_a_rod_on_a_moving_pivot():
    """The moment equation about a pivot at r sin(wt): 2 l theta'' = 3 (x'' sin(theta) - g cos(theta))."""
    scene = symgen.Scene(
        parameters={"w": "3 rad/s", "r": "0.1 m"},
        points={"A": {"at": [0, 0], "ground": True, "motion": ["r*sin(w*t)", 0]}, "B": at(0.3, -0.4)},
        links={"rod": rod("A", "B")},
        gravity={"acceleration": [0, "-9.81 m/s^2"]},
        analysis={"t_end": "1 s", "outputs": ["rod.angle", "rod.angular_acceleration"]},
    )
    found = symgen.build(scene).simulate()
    angle, pushed = found["rod.angle"].values, -0.1 * 9 * np.sin(3 * found.time)
    exact = 1.5 / 0.5 * (pushed * np.sin(angle) - 9.81 * np.cos(angle))
    assert found["rod.angular_acceleration"].values == pytest.approx(exact, rel=1e-11, abs=1e-11)
    assert found.variable("rod.angular_acceleration").unit == "rad/s^2"


@pytest.mark.parametrize(
    ("angle", "output", "message"),
    [
        ("0.3 + sin(w*t)", "rocker.speed_ratio", "needs a drive at constant speed"),
        ("0.3 + w*t", "rocker.mechanical_advantage", "its reciprocal, which is unbounded at the limit"),
        ("0.3 + w*t", "swing", "the swing is its range"),
    ],
)
def test_outputs_that_would_divide_by_zero_are_refused(angle, output, message):
    scene = four_bar(0.1, 0.35, 0.3, 0.4, 0.3).model_dump(exclude_unset=True)
    scene |= {"drivers": [{"link": "crank", "angle": angle}], "parameters": {"w": "1 rad/s"}}
    with pytest.raises(SceneError, match=message):
        symgen.build(symgen.Scene(**scene, analysis={"t_end": "1 s", "outputs": [output]}))


def test_an_angle_at_a_point_in_space():
    """A triangle of bars swinging in space keeps its angles."""
    scene = symgen.Scene(
        points={"O": ground(0, 0, 0), "A": at(0.3, 0, 0.1), "B": at(0.1, 0.4, 0)},
        links={"p": rod("O", "A"), "q": rod("A", "B"), "r": rod("B", "O")},
        gravity={"acceleration": ["1 m/s^2", "2 m/s^2", "-9 m/s^2"]},
        analysis={"t_end": "0.5 s", "outputs": ["O.A.B.angle", "A.B.O.angle", "B.O.A.angle"]},
    )
    found = symgen.build(scene).simulate()
    angles = [found[f"{corner}.angle"].values for corner in ("O.A.B", "A.B.O", "B.O.A")]
    assert np.sum(angles, axis=0) == pytest.approx(np.full(len(found.time), np.pi), abs=1e-10)
    cosine = 0.03 / np.sqrt(0.1 * 0.17)
    assert angles[2] == pytest.approx(np.full(len(found.time), np.arccos(cosine)), abs=1e-9)
