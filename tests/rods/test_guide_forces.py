"""``LINK.POINT.guide_force``, the force of a guide on a point, against closed forms and the balance of the point."""

import numpy as np
import pytest
from shared.linkages import at, ground

import symgen

G, M, F, R, L, W = 9.81, 1.3, 7.0, 0.05, 0.2, 11.0


def slider_crank(**more):
    return symgen.Scene(
        name="guided",
        parameters={"w": f"{W} rad/s"},
        points={"O": ground(0, 0), "A": at(R, 0), "B": at(R + L, 0), "E": ground(0.4, 0)},
        links={
            "crank": {"points": ["O", "A"], "mass": "0.4 kg"},
            "rod": {"points": ["A", "B"], "mass": "0 kg"},
            "rail": {"points": ["O", "E"]},
        },
        masses=[{"point": "B", "mass": f"{M} kg"}],
        guides=[{"points": ["B"], "along": "rail"}],
        drivers=[{"link": "crank", "angle": "w*t"}],
        forces=[{"point": "B", "force": [f"{F} N", "0 N"]}],
        gravity={"acceleration": ["0 m/s^2", f"{-G} m/s^2"]},
        analysis={"t_end": "0.6 s", "outputs": ["rail.B.guide_force", "B.acceleration.x"], **more},
    )


def test_of_a_slider_crank():
    """The rod without mass pushes along its line: N = m g - (m x'' - F) tan of its direction."""
    model = symgen.build(slider_crank())
    run = model.simulate(rtol=1e-12)
    angle = W * run.time
    s, c = np.sin(angle), np.cos(angle)
    root = np.sqrt(L**2 - (R * s) ** 2)
    acceleration = -R * W**2 * (c + R * (c**2 - s**2) / root + R**3 * (s * c) ** 2 / root**3)
    assert run["B.acceleration.x"].values == pytest.approx(acceleration, abs=1e-9)
    normal = M * G - (M * acceleration - F) * (-R * s / root)
    assert run["rail.B.guide_force"].values == pytest.approx(normal, abs=1e-9 * M * G)
    by_elements = model.inverse_dynamics(at=run.time, over="time")
    assert by_elements["rail.B.guide_force"].values == pytest.approx(normal, abs=1e-9 * M * G)


@pytest.mark.parametrize("dimension", [2, 3])
def test_of_a_bead_on_a_swinging_rod(dimension):
    """The force of the guide is all that acts on the bead besides gravity, m (a - g), and is normal to the rod."""
    places = {"O": (0, 0, 0), "A": (1, 0.2, -0.3), "B": (0.5, 0.1, -0.15)}
    points = {p: at(*x[:dimension]) for p, x in places.items()}
    points["O"] = ground(*places["O"][:dimension])
    gravity = [f"{x} m/s^2" for x in (0.0, -G, 0.4)[:dimension]]
    scene = symgen.Scene(
        points=points,
        links={"rod": {"points": ["O", "A"], "mass": "0.8 kg"}},
        masses=[{"point": "B", "mass": f"{M} kg"}],
        guides=[{"points": ["B"], "along": "rod"}],
        gravity={"acceleration": gravity},
        analysis={"t_end": "0.3 s", "outputs": ["rod.B.guide_force", "B.acceleration", "A.position"]},
    )
    run = symgen.build(scene).simulate(rtol=1e-11, samples=13)
    force = M * (run["B.acceleration"].values - np.array([0.0, -G, 0.4])[:dimension])
    along = run["A.position"].values
    along /= np.linalg.norm(along, axis=1)[:, None]
    assert np.abs(np.sum(force * along, axis=1)).max() < 1e-9 < np.abs(force).max()
    if dimension == 2:
        force = force[:, 1] * along[:, 0] - force[:, 0] * along[:, 1]
    assert run["rod.B.guide_force"].values == pytest.approx(force, abs=1e-9)


def test_of_a_bead_on_a_wire_in_space():
    """The wire carries what of the weight is normal to it."""
    ends, g = np.array([[0.0, 0, 0], [2, 1, -2]]), np.array([0.0, 0, -G])
    scene = symgen.Scene(
        points={"O": ground(*ends[0]), "E": ground(*ends[1]), "B": at(1, 0.5, -1)},
        links={"wire": {"points": ["O", "E"]}},
        masses=[{"point": "B", "mass": f"{M} kg"}],
        guides=[{"points": ["B"], "along": "wire"}],
        gravity={"acceleration": [f"{x} m/s^2" for x in g]},
        analysis={"t_end": "0.1 s", "outputs": ["wire.B.guide_force"]},
    )
    along = (ends[1] - ends[0]) / 3
    found = symgen.build(scene).simulate(samples=3)["wire.B.guide_force"].values
    assert found == pytest.approx(np.tile(-M * (g - (g @ along) * along), (3, 1)), abs=1e-10)


@pytest.mark.parametrize("name", ["rail.A.guide_force", "crank.A.guide_force", "rail.B.guideforce"])
def test_of_points_without_a_guide(name):
    with pytest.raises(symgen.errors.SceneError, match=f"there is no output '{name}'"):
        symgen.build(slider_crank(outputs=[name]))
