"""The motions of ``taylor.py``: as a scene, and as minimal equations in any number type.

As a program, it writes ``taylor_cases.json``: where a point is at the end of each motion, by extrapolation
with mpmath, and the change from the last tolerance but one.
"""

from __future__ import annotations

import copy
import json
import math
import sys
import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from importlib.resources import files
from pathlib import Path
from typing import Any

import chain_reference
import heyoka_peer
import minimal_equations as minimal
import mpmath
import numpy as np
import work_precision
from numpy.typing import NDArray

import symgen

Array = NDArray[np.float64]
Real = Any  # a number of mpmath

FILE = Path(__file__).with_suffix(".json")
#: Digits of the arithmetic, columns, and local errors: of motions timed in doubles, and of the others.
DIGITS, COLUMNS = 45, 14
TOLERANCES = {"timed": (1e-20, 1e-23), "digits": (1e-29, 1e-33)}


@dataclass(frozen=True)
class Case:
    """A motion of a linkage, released in a scene, and by minimal equations.

    Parameters
    ----------
    name
        Of the case in tables.
    scene
        The scene, or the name of a shipped one.
    point
        The point whose position at the end is compared; of a spatial loop, the variable.
    t_end
        Duration [s].
    rates
        Minimal equations, as a function of the module with sin, cos and sqrt and of how it reads a decimal.
    start
        Initial state of the minimal equations, in mpmath.
    place
        Position of the point, or value of the variable, for a state of the minimal equations, in mpmath.
    size
        Length that errors are relative to [m].
    """

    name: str
    scene: symgen.Scene | str
    point: str
    t_end: str
    rates: Callable[[Any, Callable[[str], Any]], minimal.Rates]
    start: Callable[[], list[Real]]
    place: Callable[[Sequence[Real]], Sequence[Real]]
    size: float = 1.0

    def truth(self) -> list[str]:
        """Return the stored position of the point at the end [m], in decimals."""
        found: list[str] = json.loads(FILE.read_text(encoding="utf-8"))["ends"][self.key]["end"]
        return found

    @property
    def key(self) -> str:
        """The name with the duration."""
        return f"{self.name}, {self.t_end} s"

    def end_of(self, run: Any) -> list[float]:
        """Return what is compared at the end of a run [m or rad]."""
        last = run.final[self.point]
        return list(last["position"]) if "position" in last else [last["value"]]

    def error(self, end: Iterable[float]) -> float:
        """Return the distance of the point from where it is, relative to the size."""
        return math.dist(end, map(float, self.truth())) / self.size

    def shifts(self) -> list[Decimal]:
        """Return where the point is at the end [m], rounded to 44 binary digits behind the point."""
        with localcontext(prec=DIGITS):
            return [round(Decimal(x) * 2**44) / Decimal(2**44) for x in self.truth()]

    def shifted(self) -> symgen.Scene:
        """Return the scene, shifted so that the point ends next to the origin; drawn places stay exact."""
        assert isinstance(self.scene, symgen.Scene)
        data = copy.deepcopy(self.scene.model_dump(exclude_unset=True))
        with localcontext(prec=DIGITS):
            for point in data["points"].values():
                places = [Decimal(place.removesuffix(" m")) for place in point["at"]]
                point["at"] = [f"{x - shift} m" for x, shift in zip(places, self.shifts(), strict=True)]
        return symgen.Scene(**data)

    def error_of_shifted(self, end: Iterable[float]) -> float:
        """Return the largest error [m] of the point's position in a run of the shifted scene."""
        with localcontext(prec=DIGITS):
            rows = zip(end, self.shifts(), self.truth(), strict=True)
            return max(float(abs(Decimal(float(x)) + shift - Decimal(true))) for x, shift, true in rows)

    def solve(self, tolerance: float, columns: int = COLUMNS) -> list[Real]:
        """Return the position of the point at the end [m], in the present precision of mpmath."""
        times = [mpmath.mpf(0), mpmath.mpf(self.t_end)]
        rates = self.rates(mpmath, mpmath.mpf)
        return list(
            self.place(chain_reference.integrated(rates, self.start(), times, tolerance, columns)[-1])
        )

    def in_heyoka(self) -> list[heyoka_peer.Program]:
        """Return the forms of the equations that heyoka is given."""
        rates = self.rates(heyoka_peer.module(), heyoka_peer.number)

        def place(y: Array) -> list[float]:
            return [float(x) for x in self.place(list(map(mpmath.mpf, y)))]

        start = np.array(self.start(), dtype=float)
        programs = [heyoka_peer.Program("minimal equations", rates, start, place)]
        if isinstance(self.scene, symgen.Scene) and self.scene.points and not self.scene.start.rates:
            programs.append(heyoka_peer.from_record(self.scene))
        return programs


def _rods(count: int, start: Callable[[], list[Real]], name: str, t_end: str, scene: symgen.Scene) -> Case:
    def place(y: Sequence[Real]) -> list[Real]:
        return [mpmath.fsum(map(f, y[:count])) for f in (mpmath.cos, mpmath.sin)]

    def rates(of: Any, number: Callable[[str], Any]) -> minimal.Rates:
        return chain_reference.rates_of(count, of, number)

    return Case(name, scene, f"P{count}", t_end, rates, start, place)


def chain(count: int) -> Case:
    """Return the falling chain of ``work_precision.py``."""
    bend = chain_reference.BEND

    def start() -> list[Real]:
        return [mpmath.mpf(bend) * ((i + 1) // 2) for i in range(count)] + [mpmath.mpf(0)] * count

    return _rods(count, start, f"chain of {count}", str(chain_reference.T_END), work_precision.scene(count))


def two_rods() -> Case:
    """Return two rods, released from horizontal, over 10 s."""
    points = {f"P{i}": {"at": [f"{i} m", "0 m"], "ground": i == 0} for i in range(3)}
    scene = _scene(points, {f"L{i}": {"points": [f"P{i}", f"P{i + 1}"], "mass": "1 kg"} for i in range(2)})
    return _rods(2, lambda: [mpmath.mpf(0)] * 4, "two rods", "10", scene)


def _scene(points: dict[str, Any], links: dict[str, Any], **more: Any) -> symgen.Scene:
    down = ["0 m/s^2"] * (len(points["P0"]["at"]) - 1) + [f"-{chain_reference.GRAVITY} m/s^2"]
    return symgen.Scene(points=points, links=links, gravity={"acceleration": down}, **more)


def linkage(name: str, point: str, form: minimal.Linkage, t_end: str, size: float = 1.0) -> Case:
    """Return a shipped linkage with one freedom."""

    def place(y: Sequence[Real]) -> list[Real]:
        return [x.value for x in form.places(y[0], mpmath, mpmath.mpf)[point]]

    return Case(
        name.replace("_", " "),
        name,
        point,
        t_end,
        form.rates_of,
        lambda: list(map(mpmath.mpf, form.start)),
        place,
        size,
    )


def pendulum_in_space() -> Case:
    """Return two rods in space on springs, released at rest."""
    first, second = minimal.DIRECTIONS
    at = [
        (0, 0, 0),
        first,
        [mpmath.nstr(mpmath.mpf(a) + mpmath.mpf(b), 8) for a, b in zip(first, second, strict=True)],
    ]
    points = {f"P{i}": {"at": [f"{x} m" for x in place], "ground": i == 0} for i, place in enumerate(at)}
    points |= {
        f"S{i}": {"at": [f"{x} m" for x in place], "ground": True}
        for i, (place, _, _) in enumerate(minimal.SPRINGS, 1)
    }
    scene = _scene(
        points,
        {f"L{i}": {"points": [f"P{i}", f"P{i + 1}"], "mass": "1 kg"} for i in range(2)},
        springs=[
            {"between": [f"S{i}", f"P{i}"], "stiffness": f"{k} N/m", "length": f"{free} m"}
            for i, (_, k, free) in enumerate(minimal.SPRINGS, 1)
        ],
    )

    def start() -> list[Real]:
        angles = []
        for x, y, z in (map(mpmath.mpf, d) for d in minimal.DIRECTIONS):
            angles += [mpmath.atan2(z, y), mpmath.asin(x)]
        return angles + [mpmath.mpf(0)] * 4

    def place(y: Sequence[Real]) -> list[Real]:
        one, two = (rod[0] for rod in minimal.directions(y, mpmath))
        return [a + b for a, b in zip(one, two, strict=True)]

    return Case("pendulum in space", scene, "P2", "2", minimal.pendulum_in_space, start, place)


def free_rssr() -> Case:
    """Return the shipped crank-rocker between skew axes, with a free crank that is pushed."""
    tables = tomllib.loads((files("symgen") / "scenes" / "rssr.toml").read_text("utf-8"))
    del tables["loop"]["inputs"], tables["parameters"]["speed"]
    tables["loop"]["free"] = {"theta1": {"at": "0.5 rad", "rate": "3 rad/s"}}
    start = ["0.5", "3"]
    return Case(
        "free RSSR",
        symgen.Scene(**tables, analysis={"t_end": "2 s"}),
        "theta1",
        "2",
        minimal.rssr,
        lambda: list(map(mpmath.mpf, start)),
        lambda y: y[:1],
    )


def free_rssr_of_points() -> Case:
    """Return the same crank-rocker by its two balls, each on rods to two points of an axis."""
    size = {name: mpmath.mpf(x) for name, x in minimal.RSSR.items()}
    near, _, rod = ([x.value for x in xs] for xs in minimal.rssr_tips(mpmath, mpmath.mpf)(mpmath.mpf("0.5")))
    at = {
        "P0": (0, 0, 0),
        "P1": (0, 0, size["rise"]),
        "Q0": (size["distance"], -size["rise"] * size["sin"], -size["rise"] * size["cos"]),
        "Q1": (size["distance"], 0, 0),
        "A": near,
        "B": [a + b for a, b in zip(near, rod, strict=True)],
    }
    points = {
        p: {"at": [f"{mpmath.nstr(mpmath.mpf(x), 17)} m" for x in place], "ground": p[0] in "PQ"}
        for p, place in at.items()
    }
    ends = {"crank": ["P0", "A"], "rod": ["A", "B"], "rocker": ["Q0", "B"]}
    mass = {name: mpmath.mpf(minimal.LINE) * size[name] for name in ends}
    links = {name: {"points": p, "mass": f"{mpmath.nstr(mass[name], 17)} kg"} for name, p in ends.items()}
    moment = mass["rod"] * (3 * mpmath.mpf(minimal.RADIUS) ** 2 + size["rod"] ** 2) / 12
    links["rod"]["inertia"] = f"{mpmath.nstr(moment, 17)} kg*m^2"
    links |= {p + q: {"points": [p, q], "mass": "0 kg"} for p, q in (("P1", "A"), ("Q1", "B"))}

    def place(y: Sequence[Real]) -> list[Real]:
        return [x.value for x in minimal.rssr_tips(mpmath, mpmath.mpf)(y[0])[0]]

    scene = _scene(points, links, start={"rates": {"crank": ["0 rad/s", "0 rad/s", "3 rad/s"]}})
    return replace(free_rssr(), name="free RSSR of points", scene=scene, point="A", place=place, size=0.1)


def drawn_four_bar() -> Case:
    """Return a four-bar linkage, released at rest from places and with masses that doubles hold exactly."""
    at = {"P0": ("0", "0"), "A": ("0.5", "0.875"), "B": ("2.25", "1.5"), "C": ("2", "0")}
    rods = {"crank": ("P0", "A", "1"), "coupler": ("A", "B", "1.75"), "rocker": ("B", "C", "1.5")}
    points = {p: {"at": [f"{x} m" for x in place], "ground": p in ("P0", "C")} for p, place in at.items()}
    scene = _scene(points, {name: {"points": [a, b], "mass": f"{m} kg"} for name, (a, b, m) in rods.items()})
    with mpmath.workdps(DIGITS):
        places = {p: [mpmath.mpf(x) for x in place] for p, place in at.items()}
        lengths = {
            name: mpmath.nstr(
                mpmath.hypot(*(x - y for x, y in zip(places[a], places[b], strict=True))), DIGITS
            )
            for name, (a, b, _) in rods.items()
        }
        angle = mpmath.nstr(mpmath.atan2(*places["A"][::-1]), DIGITS)
    form = minimal.Linkage(
        ground={"P0": at["P0"], "C": at["C"]},
        crank=("P0", "A", lengths["crank"]),
        placed=[minimal.Dyad("B", "A", "C", (lengths["coupler"], lengths["rocker"]))],
        bodies=[minimal.Body(a, b, lengths[name], m) for name, (a, b, m) in rods.items()],
        start=(angle, "0"),
    )
    return replace(linkage("drawn four bar", "B", form, "1"), scene=scene)


def cases() -> list[Case]:
    """Return the motions whose times are compared."""
    return [
        chain(3),
        chain(10),
        linkage("peaucellier", "C", minimal.PEAUCELLIER, "1", 0.06),
        linkage("four_bar", "B", minimal.FOUR_BAR, "2"),
        linkage("andrews_squeezer", "E", minimal.ANDREWS, "0.03", 0.07),
        pendulum_in_space(),
        free_rssr(),
        free_rssr_of_points(),
    ]


def of_digits() -> list[Case]:
    """Return the motions whose digits in float128 are counted."""
    return [two_rods(), drawn_four_bar()]


def main() -> int:
    """Compute and store all ends, or those of the motions that are named."""
    names = sys.argv[1:]
    stored = json.loads(FILE.read_text(encoding="utf-8"))["ends"] if names else {}
    chosen = [("digits", c) for c in of_digits()] + [("timed", c) for c in cases()]
    for kind, case in ((kind, c) for kind, c in chosen if not names or c.key in names):
        with mpmath.workdps(DIGITS):
            coarse, fine = (case.solve(tolerance) for tolerance in TOLERANCES[kind])
            moved = max(abs(a - b) for a, b in zip(coarse, fine, strict=True))
            end = [mpmath.nstr(x, 34) for x in fine]
            stored[case.key] = {"point": case.point, "moved": mpmath.nstr(moved, 2), "end": end}
            print(case.key, stored[case.key], flush=True)
    about = "Where a point is at the end of each motion [m], see taylor_cases.py"
    FILE.write_text(json.dumps({"about": about, "ends": stored}, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
