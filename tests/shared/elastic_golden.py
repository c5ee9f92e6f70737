"""Golden numbers of the elastic four-bar of the thesis, computed beforehand and independently; ft, lbf, s, 1e-6."""

DEGREES = (0, 60, 120, 200, 300)
#: Angles of coupler and output [deg], rates [rad/s] and accelerations [rad/s^2] at those angles of the crank.
KINEMATICS = (
    (110.48731511, 128.68218745, -68.35582015, -68.35582015, -5878.727681, -2743.406251),
    (36.33423644, 87.34556900, -16.15894070, 11.76684625, 1218.094945, 1216.610960),
    (27.08324858, 117.79946448, 1.04994947, 22.75753358, 445.751201, -37.898247),
    (48.02717147, 155.16288899, 20.17445572, 11.20392490, 509.396273, -428.490104),
    (114.23078757, 165.24212013, 24.97904652, -2.94674042, -475.824883, -477.308867),
)
#: At the crank angle [deg], without bearings: nodal forces of Chapter IV at M, A, B, Q (x, y) [lbf], the driving
#: torque and the nodal moments in the middle of crank, coupler and output [lbf ft].
FORCES = {
    0: (
        (7.23432752, -20.54161152, 6.04186195, -20.54161152),
        (14.02712246, -24.24121565, 25.65366176, -28.68074061),
        (11.98260672, 5.99130336, 0.64430510, -0.78765765),
    ),
    60: (
        (5.75364601, 4.87082760, 5.15741322, 3.83812213),
        (1.96720776, 2.20593971, -0.83892546, 2.01767306),
        (1.48597739, 0.74298869, -0.05993076, 0.34930041),
    ),
    200: (
        (-3.49730219, -2.25807778, -2.37675109, -1.85023053),
        (-0.21342032, -0.62421698, 0.46163187, 0.14783258),
        (-0.54002155, -0.27001078, 0.08212743, -0.12302353),
    ),
}
#: With bearings: the torque at ``DEGREES``, and its extremes over a revolution.
TORQUE = (31.57202591, 2.98141345, -0.17147759, -1.04151706, 0.40580695)
TORQUE_EXTREMES = (50.90, -53.63)
#: Largest forces of the joints on a grid of a degree without bearings: joint, lbf, at degrees.
PEAK_FORCES = {"M": (45.471, 16), "A": (44.843, 16), "B": (44.853, 353), "Q": (51.624, 354)}
#: Frequencies [Hz] of the structure in its pose: crank, degrees.
FREQUENCIES = {
    ("held", 0): (7.9504, 83.6901, 122.9784, 325.306, 364.5383, 464.524, 1185.0178, 1491.6969, 3094.6776, 4216.245),
    ("held", 60): (22.9171, 80.25, 123.8949, 319.9309, 372.8537, 460.4116, 1200.5115, 1557.8361, 2444.4888, 4522.362),
    ("free", 0): (
        *(0, 83.6321, 122.8527, 233.5088, 325.5963, 464.4394, 932.6963, 1482.8408, 3092.1066, 3685.3896),
        4231.5787,
    ),
}  # fmt: skip
#: Quasi-static strain at mid-length at ``DEGREES``, held crank.
QUASI_STATIC = {
    "crank": (-7062.32626, -666.91036, 38.35771, 232.97624, -90.77468),
    "coupler": (-288.24834, 26.81174, -125.43539, -36.74206, -19.40894),
    "output": (352.38121, -156.26954, 4.86790, 55.03810, 61.30870),
}
QUASI_STATIC_AXIAL_OUTPUT = (68.32409, -4.29979, 3.20855, 0.18164, 2.05629)
#: One revolution from rest, crank held, exact form, without geometric stiffness: at 90, 180, 270, 360 deg; peak.
TRANSIENT = {
    "crank": (-6030.034, 11674.658, 12991.194, 3280.787, 13136.1),
    "coupler": (599.931, 193.302, 1341.743, 30.133, 3185.5),
    "output": (1145.384, -2160.915, -1528.654, 2213.741, 4156.7),
}
#: Largest Floquet multiplier: crank, form, links that stretch, geometric stiffness.
FLOQUET = {
    ("free", "thesis", True, False): 14834.5,
    ("free", "thesis", False, False): 21.213,
    ("free", "exact", True, False): 3111.16,
    ("free", "exact", True, True): 5.66872,
    ("held", "exact", True, False): 3.60467,
    ("held", "exact", True, True): 1.25165,
    ("rigid", "exact", True, True): 1.0000,
}
#: Free crank, E times 1e4: the multiplier of the rigid linkage, that of the elements, and without geometric stiffness.
STIFF_LIMIT, STIFF_ELEMENTS, STIFF_WITHOUT = -5.364684, -5.364713, 3182.0
