"""Random scenes with elastic links as dictionaries: linkages in the plane and in space; see ``transformed``."""

from __future__ import annotations

import copy

import numpy as np
from shared.transformed import in_unit, texts

Tables = dict


class Sketch:
    """Points, links and the random numbers of a scene."""

    def __init__(self, rng: np.random.Generator, dimension: int) -> None:
        self.rng, self.dimension = rng, dimension
        self.at: dict[str, np.ndarray] = {}
        self.turn = np.eye(dimension)
        self.ground: set[str] = set()
        self.tables: Tables = {"parameters": {}, "points": {}, "links": {}}

    def number(self, low: float, high: float) -> float:
        return round(float(self.rng.uniform(low, high)), 4)

    def vector(self, size: float) -> np.ndarray:
        return np.round(self.rng.uniform(-size, size, self.dimension), 4)

    def chance(self, p: float = 0.5) -> bool:
        return bool(self.rng.random() < p)

    def any_of(self, *choices):
        return choices[int(self.rng.integers(len(choices)))]

    def point(self, name: str, at, ground: bool = False) -> None:
        self.at[name] = np.asarray(at, dtype=float)
        self.tables["points"][name] = {"at": texts(at, "m"), "ground": ground}
        if ground:
            self.ground.add(name)

    def turned_point(self, name: str, at, ground: bool = False) -> None:
        self.point(name, self.turn @ at, ground)

    def add(self, table: str, **entry) -> None:
        self.tables.setdefault(table, []).append(entry)

    def parameter(self, name: str, value: float, unit: str, tunable: bool = False) -> str:
        text = in_unit(value, unit)
        self.tables["parameters"][name] = {"value": text, "tunable": True} if tunable else text
        return name


def in_plane(rng: np.random.Generator) -> Tables:
    """Return a four-bar, slider-crank or frame with one to three elastic links and what may be attached to them."""
    s = Sketch(rng, 2)
    crank, gap = s.number(0.08, 0.12), s.number(0.35, 0.45)
    turned = rng.uniform(-3, 3)
    turn = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
    angle = rng.uniform(-3, 3)
    a = crank * np.array([np.cos(angle), np.sin(angle)])
    s.point("O", turn @ [0, 0], True)
    s.point("A", turn @ a)
    kind = s.any_of("four-bar", "four-bar", "slider", "frame")
    if kind == "slider":
        rod, offset = s.number(0.3, 0.45), s.number(-0.05, 0.05)
        x = a[0] + np.sqrt(rod**2 - (offset - a[1]) ** 2)
        s.point("B", turn @ [x, offset])
        s.point("R", turn @ [0, offset], True)
        s.point("S", turn @ [1, offset], True)
        s.tables["links"]["rail"] = {"points": ["R", "S"]}
        s.add("guides", points=["B"], along="rail")
        members = {"L0": ["O", "A"], "L1": ["A", "B"]}
    else:
        s.point("Q", turn @ [gap, 0], True)
        lengths = s.number(0.33, 0.4), s.number(0.3, 0.4)
        across = np.array([gap, 0]) - a
        d = np.linalg.norm(across)
        along = (lengths[0] ** 2 - lengths[1] ** 2 + d**2) / (2 * d)
        side = s.any_of(-1, 1) * np.sqrt(lengths[0] ** 2 - along**2)
        b = a + (along * across + side * np.array([-across[1], across[0]])) / d
        s.point("B", turn @ b)
        members = {"L0": ["O", "A"], "L1": ["A", "B"], "L2": s.any_of(["Q", "B"], ["B", "Q"])}
    if s.chance():
        members["L1"].reverse()
    frame = kind == "frame"
    elastic = {name for name in members if s.chance(0.4)} or {"L1"}
    if frame:
        elastic |= {"L2"}
    for name, points in members.items():
        s.tables["links"][name] = _bar(s, points, name in elastic)
    if frame:
        s.add("welds", point="Q", links=["L2"])
    elif {"L1", "L2"} <= elastic and s.chance(0.3):
        s.add("welds", point="B", links=["L1", "L2"])
    _input(s, frame)
    if s.chance():
        s.tables["gravity"] = {"acceleration": texts(s.vector(10), "m/s^2")}
    if s.chance(0.15):
        s.tables["modal_damping"] = {"ratio": s.number(0.01, 0.1)}
    _attached(s, sorted(elastic))
    for name in sorted(elastic):
        at = s.number(0.1, 0.9)
        fibre = in_unit(s.any_of(-1, 1) * s.number(1e-3, 2e-3), "m")
        s.add("stations", link=name, at=at, fibre=fibre, name=f"on_{name}")
    return s.tables


def undamped(tables: Tables) -> Tables:
    """Return the scene without damping and loads that vary with time: its motion runs back in time, too."""
    made = copy.deepcopy(tables)
    made.pop("modal_damping", None)
    for link in made["links"].values():
        link.get("elastic", {}).pop("damping", None)
    for spring in (*made.get("springs", ()), *made.get("torsion_springs", ())):
        spring.pop("damping")
    made["forces"] = [force for force in made.get("forces", ()) if "*t)" not in force["force"][0]]
    return made


def _bar(s: Sketch, points: list[str], elastic: bool) -> Tables:
    link: Tables = {"points": points}
    if not elastic and s.chance():
        return link | {"mass": in_unit(s.number(0.1, 0.5), "kg")}
    taper = elastic and s.chance(0.25)
    sizes = texts(sorted(s.rng.uniform(4e-3, 8e-3, 2)), "m") if taper else in_unit(s.number(5e-3, 8e-3), "m")
    link |= {"density": "7850.0 kg/m^3"}
    link["section"] = (
        {"diameter": sizes}
        if s.chance(0.2)
        else {"width": in_unit(s.number(1e-2, 2e-2), "m"), "thickness": sizes}
    )
    if not elastic:
        return link
    kind = s.any_of("cubic", "beam8", "beam8", "rayleigh", "timoshenko", "beam9")
    made: Tables = {"E": "70e9 Pa", "element": kind, "elements": int(s.rng.integers(1, 4))}
    if kind == "timoshenko":
        made["shear"] = {"poisson": 0.3}
    if s.chance(0.2):
        made["axial"] = False
    elif s.chance(0.2):
        made["reduction"] = s.any_of("guyan", {"kind": "craig-bampton", "modes": 1})
    if s.chance(0.2):
        made["geometric_stiffness"] = False
    if s.chance():
        made["damping"] = {
            "ratio": s.number(0.005, 0.05) if s.chance() else 0,
            "mass": in_unit(s.number(0.1, 2), "1/s"),
            "stiffness": in_unit(s.number(1e-5, 1e-4), "s"),
        }
    return link | {"elastic": made}


def _input(s: Sketch, frame: bool) -> None:
    """Add the crank: at rest, at constant speed, at a prescribed angle, with a motor or free."""
    crank: Tables = {"link": "L0"}
    s.tables["crank"] = crank
    if frame:
        crank["speed"] = "0.0 rad/s"
        return
    speed = s.any_of(-1, 1) * s.number(3, 12)
    kind = s.any_of("held", "held", "held", "motor", "free", "prescribed")
    if kind == "prescribed":
        along = s.at["A"] - s.at["O"]
        s.parameter("begin", float(np.arctan2(*along[::-1])), "rad")
        s.parameter("swing", s.number(0.2, 0.8), "rad")
        s.parameter("rate", abs(speed), "rad/s")
        crank["angle"] = "begin + swing*sin(rate*t)"
        s.tables["analysis"] = {"t_end": "0.05 s"}
        return
    crank["speed"] = s.parameter("pace", speed, "rad/s", tunable=True)
    if kind != "held":
        crank["mode"] = kind
    if kind == "motor":
        s.parameter("stall", 2 * np.sign(speed) * s.number(0.5, 2), "N*m")
        crank["torque"] = "stall*(1 - this.rate/(2*pace))"
        crank["flywheel"] = in_unit(s.number(0.01, 0.05), "kg*m^2")


def _attached(s: Sketch, elastic: list[str]) -> None:
    """Add points on links, masses, springs, forces and couples."""
    links = s.tables["links"]
    name = s.any_of(*elastic)
    stretches = links[name]["elastic"].get("axial", True) and "reduction" not in links[name]["elastic"]
    whole = [k for k in links if k != "rail"]
    if stretches and s.chance(0.4):
        s.tables["points"]["C"] = {"on": name, "fraction": s.any_of(0.5, 0.3)}
        s.add("masses", point="C", mass=in_unit(s.number(0.02, 0.1), "kg"))
    if s.chance(0.5):
        s.add("masses", point="B", mass=in_unit(s.number(0.05, 0.3), "kg"))
    if s.chance(0.3):
        s.add(
            "masses",
            point="B",
            mass=in_unit(s.number(0.05, 0.3), "kg"),
            inertia=in_unit(s.number(1e-4, 1e-3), "kg*m^2"),
            link=s.any_of(*(k for k in whole if "B" in links[k]["points"])),
        )
    if s.chance(0.5):
        s.parameter("w", s.number(20, 60), "rad/s")
        forces = [s.parameter(f"F{k}", x, "N") for k, x in enumerate(s.vector(5))]
        s.add("forces", point="B", force=[f"{f}*cos(w*t)" for f in forces])
    if s.chance(0.3):
        point = s.any_of(*links[name]["points"])
        if point not in s.ground:
            s.add("forces", point=point, link=name, force=texts(s.vector(5), "N"))
    if s.chance(0.4):
        loads = {"force": texts(s.vector(10), "N/m"), "end": texts(s.vector(10), "N/m")}
        s.add("distributed_forces", link=name, **loads, axes=s.any_of("fixed", "link", "section"))
    if s.chance(0.4):
        s.point("G", s.at["B"] + s.vector(0.3), True)
        s.add(
            "springs",
            between=s.any_of(["G", "B"], ["B", "G"]),
            stiffness=in_unit(s.number(20, 200), "N/m"),
            length=in_unit(s.number(0.1, 0.4), "m"),
            damping=in_unit(s.number(0, 2), "N*s/m"),
        )
    both = [k for k in elastic if "B" in links[k]["points"]]
    if len(both) == 2 and "welds" not in s.tables and s.chance(0.5):
        one, other = both if s.chance() else both[::-1]
        ends = [s.at[q] - s.at[p] for p, q in (links[k]["points"] for k in (one, other))]
        drawn = [np.arctan2(*x[::-1]) for x in ends]
        s.add(
            "torsion_springs",
            link=one,
            against=other,
            point="B",
            stiffness=in_unit(s.number(0.5, 5), "N*m"),
            angle=in_unit(drawn[0] - drawn[1] + s.number(-0.5, 0.5), "rad"),
            damping=in_unit(s.number(0, 0.05), "N*m*s"),
        )
    if s.chance(0.3):
        point = s.any_of(*links[name]["points"])
        s.add("torques", link=name, point=point, torque=in_unit(s.number(-0.5, 0.5), "N*m"))


def in_space(rng: np.random.Generator) -> Tables:
    """Return a frame, a driven four-bar or a slider on a moving point, in space, with elastic links."""
    s = Sketch(rng, 3)
    s.turn = _rotation(rng)
    s.parameter("rate", s.number(10, 40), "rad/s")
    s.any_of(_frame, _frame, _driven, _slider)(s)
    s.tables["gravity"] = {"acceleration": texts(s.vector(10), "m/s^2")}
    free = next(p for p in ("B", "A") if p in s.at and p not in s.ground)
    if s.chance():
        s.add("masses", point=free, mass=in_unit(s.number(0.05, 0.3), "kg"))
    if s.chance():
        s.add("forces", point=free, force=texts(s.vector(4), "N"))
    if s.chance(0.4):
        s.point("G", s.at[free] + s.vector(0.3), True)
        s.add(
            "springs",
            between=s.any_of(["G", free], [free, "G"]),
            stiffness=in_unit(s.number(20, 200), "N/m"),
            length=in_unit(s.number(0.1, 0.4), "m"),
            damping=in_unit(s.number(0, 1), "N*s/m"),
        )
    for name, link in s.tables["links"].items():
        if "elastic" in link:
            s.add("stations", link=name, at=s.number(0.1, 0.9), name=f"on_{name}")
    s.tables["analysis"] = {"t_end": "0.001 s"}
    return s.tables


def _frame(s: Sketch) -> None:
    """Add one or two rods, clamped to the ground."""
    s.turned_point("O", [0, 0, 0], True)
    s.turned_point("A", [s.number(0.2, 0.4), s.number(-0.1, 0.1), s.number(-0.1, 0.1)])
    s.tables["links"]["L0"] = _rod(s, s.any_of(["O", "A"], ["A", "O"]))
    s.add("welds", point="O", links=["L0"])
    if s.chance():
        s.turned_point("B", [s.number(0.2, 0.4), s.number(0.2, 0.4), s.number(-0.2, 0.2)], s.chance(0.3))
        s.tables["links"]["L1"] = _rod(s, s.any_of(["A", "B"], ["B", "A"]))
        s.add("welds", point="A", links=s.any_of(["L0", "L1"], ["L1", "L0"]))


def _driven(s: Sketch) -> None:
    """Add a four-bar with a driven crank."""
    s.turned_point("O", [0, 0, 0], True)
    s.turned_point("A", [0, 0.06, 0])
    s.turned_point("B", [0.24, 0.14, s.number(-0.03, 0.03)])
    s.turned_point("Q", [0.22, 0, 0], True)
    s.tables["links"]["L0"] = {"points": ["O", "A"], "mass": in_unit(s.number(0, 0.2), "kg")}
    s.tables["links"]["L1"] = _rod(s, s.any_of(["A", "B"], ["B", "A"]))
    s.tables["links"]["L2"] = _rod(s, s.any_of(["B", "Q"], ["Q", "B"]))
    axis = (s.turn @ [0, 0, 1]).tolist()
    s.add("joints", point="O", links=["L0"], kind="revolute", axis=axis)
    s.add("drivers", link="L0", angle="rate*t")
    s.add("joints", point="Q", links=["L2"], kind="revolute", axis=axis)
    # Without it the coupler spins about its line against almost nothing: its equilibrium is round-off.
    s.add("joints", point="A", links=["L1", "L0"], kind=s.any_of("revolute", "universal"), axis=axis)


def _slider(s: Sketch) -> None:
    """Add a rod between a moving ground point and a slider."""
    s.turned_point("A", [0, 0.05, 0], True)
    s.turned_point("B", [0.3, 0, 0])
    s.turned_point("R", [0, 0, 0], True)
    s.turned_point("S", [0.5, 0, 0], True)
    s.tables["links"]["rail"] = {"points": ["R", "S"]}
    s.tables["links"]["L0"] = _rod(s, s.any_of(["A", "B"], ["B", "A"]))
    s.add("guides", points=["B"], along="rail")
    r = s.parameter("r", 0.05, "m")
    motion = [f"{r}*sin(rate*t)", f"{r}*cos(rate*t) - {r}", f"{r}*sin(rate*t)"]
    s.tables["points"]["A"]["motion"] = [
        " + ".join(f"({float(x)!r})*({c})" for x, c in zip(row, motion, strict=True)) for row in s.turn
    ]
    s.add("masses", point="B", mass=in_unit(s.number(0.1, 0.4), "kg"))
    axis = (s.turn @ [0, 0, 1]).tolist()
    s.add("joints", point="B", links=["L0"], kind="universal", axis=axis)


def _rotation(rng: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def _rod(s: Sketch, points: list[str]) -> Tables:
    """Return an elastic link in space."""
    if s.chance(0.25):
        section: Tables = {"diameter": in_unit(s.number(4e-3, 8e-3), "m")}
    else:
        section = {
            "width": in_unit(s.number(8e-3, 1.6e-2), "m"),
            "thickness": in_unit(s.number(4e-3, 8e-3), "m"),
            "width_along": s.rng.normal(size=3).tolist(),
        }
    elastic: Tables = {"E": "70e9 Pa", "elements": int(s.rng.integers(1, 3)), "shear": {"poisson": 0.3}}
    if s.chance():
        elastic["damping"] = {"stiffness": in_unit(s.number(1e-6, 1e-5), "s")}
    return {"points": points, "density": "2700.0 kg/m^3", "section": section, "elastic": elastic}
