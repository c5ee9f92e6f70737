"""Entries of the thesis' matrices and polynomials as its print gives them, in its own letters.

The scan is noisy. A digit or letter with only one possible reading (l for 1, S for 5 in an exponent) is written so;
one that cannot be read by itself is ``?``. The notation is that of the print: ``3x4/2L2`` is 3 x^4/(2 L^2), and a
denominator ends at the first blank. Its dotted theta is ``w`` here, the twice dotted ``a``; the origin's velocity
along and across the link is ``X``, ``Y`` and the rates of these components are ``p``, ``r``. In a matrix with
letters, ``C`` and ``S`` are the cosine and sine of the link's angle where the letters leave them free.
"""

from __future__ import annotations

from shared.elastic_notation import listed, matrix

_SOLVED = """
F = 1/2; G = 1/L; H = 10/L3; J = 6/L2
K = 3/2L; Z = 4/L2; B = 1/2L; C = 15/L4
D = 8/L3; U = 3/2L2; I = 7/L3; P = 1/L2
Q = 3/L4; N = 1/2L3; M = 6/L5
"""
_MASS = """
A = L/3 m; B = L/6 m; D = 181L/462 m
E = 311L2/4620 m; F = 281L3/55440 m; G = 25L/231 m
H = 151L2/4620 m; J = 181L3/55440 m; L = 52L3/3465 m
M = 23L4/18480 m; N = 19L3/1980 m; P = 13L4/13860 m
Q = L5/9240 m; W = L5/11088 m
"""
_TURNING = """
A = 5L/14 m; B = 13L2/210 m; H = L3/210 m
D = L/7 m; E = 4L2/105 m; F = L3/280 m
"""
_STIFFNESS = """
A = EA/L - w2 L/3 m; B = 5aL/14 m; D = 13aL2/210 m
E = aL3/210 m; F = EA/L + w2 L/6 m; H = aL/7 m
I = 4aL2/105 m; J = aL3/280 m; K = 120EI/7L3 - 181w2L/462 m
L = 60EI/7L2 - 311w2L2/4620 m; M = 3EI/7L - 281w2L3/55440 m; N = 120EI/7L3 + 25w2L/231 m
P = 60EI/7L2 + 151w2L2/4620 m; Q = 3EI/7L + 181w2L3/55440 m; R = 192EI/35L - 52w2L3/3465 m
U = 11EI/35 - 23w2L4/18480 m; V = 108EI/35L + 19w2L3/1980 m; Z = 4EI/35 + 13w2L4/13860 m
X = 3L EI/35 + w2L5/9240 m; Y = L EI/70 - w2L5/11088 m
"""
_LOAD = """
A = YwL/2 m - pL/2 m + w2L2/6 m; B = -XwL/2 m - rL/2 m - aL2/7 m; D = -XwL2/10 m - rL2/10 m - 4aL3/105 m
E = -XwL3/120 m - rL3/120 m - aL4/280 m; F = YwL/2 m - pL/2 m + w2L2/3 m; G = -XwL/2 m - rL/2 m - 5aL2/14 m
H = XwL2/10 m + rL2/10 m + 13aL3/210 m; I = -XwL3/120 m - rL3/120 m - aL4/210 m
"""

MATRICES = {
    "5.23": matrix("""
        ? 0 0 0 0 0 0 0
        ? ? 0 0 0 0 0 0
        0 0 1 0 0 0 0 0
        0 0 0 1/2 0 0 0 0
        -1/L 0 0 0 1/L 0 0 0
        0 -10/L3 -6/L2 -3/2L 0 10/L3 -4/L2 1/2L
        0 15/L4 8/L3 3/2L2 0 -15/L4 7/L3 -1/L2
        0 -6/L5 -3/L4 -1/2L3 0 6/L5 -3/L5 1/2L3
    """),
    "B.8": matrix("""
        ? 0 0 0 0 0 0 0
        ? ? 0 0 0 0 0 0
        ? ? ? 0 0 0 0 0
        0 0 0 F 0 0 0 0
        -G 0 0 0 G 0 0 0
        0 -H -J -K 0 H -Z B
        0 C D U 0 -C I -P
        0 -M -Q -N 0 M -Q N
    """, _SOLVED),
    "B.10": matrix("""
        L/3 0 0 0 L/6 0 0 0
        0 0 0 0 0 0 0 0
        0 0 0 0 0 0 0 0
        0 0 0 0 0 0 0 0
        L/6 0 0 0 L/3 0 0 0
        0 0 0 0 0 0 0 0
        0 0 0 0 0 0 0 0
        0 0 0 0 0 0 0 0
    """),
    "B.14": matrix("""
        0 5L/14 13L2/210 L3/210 0 L/7 -4L2/105 L3/280
        0 0 0 0 0 0 0 0
        0 0 0 0 0 0 0 0
        0 0 0 0 0 0 0 0
        0 L/7 4L2/280 L3/280 0 5L/14 -13L2/210 L3/210
        0 0 0 0 0 0 0 0
        0 0 0 0 0 0 0 0
        0 0 0 0 0 0 0 0
    """),
    "B.15": matrix("\n".join(["? ? ? ? ? ? ? ?"] * 8)),
    "B.16": matrix("0 L/2 L2/10 L3/120 0 L/2 -L2/10 L3/120"),
    "B.17": matrix("""
        0 0 0 0 0 0 0 0
        0 A B C 0 D -E F
        0 B G I 0 E -K L
        0 C I H 0 F -L J
        0 0 0 0 0 0 0 0
        0 D E F 0 A -B C
        0 -E -K -L 0 -B G -I
        0 F L J 0 C -I H
    """, """
        A = 181L/462 m;
        B = 311L2/4620 m;
        C = 281L3/55440 m;
        D = 25L/231 m;
        E = 151L2/4620 m;
        F = 181L3/55440 m;
        G = 52L3/3465 m;
        H = L5/9240 m;
        I = 23L4/18480 m;
        J = L5/11088 m;
        K = 19L3/1980 m;
        L = 13L4/13860 m
    """),
    "B.18": matrix("L2/6 0 0 0 L2/3 0 0 0"),
    "B.19": matrix("0 L2/7 4L3/105 L4/280 0 5L2/14 -13L3/210 L4/210"),
    "D.28": matrix("""
        X 0 0 -F -X 0 0 0
        0 B C F 0 -B C -F
        0 C G J 0 -C N -M
        0 F J H 0 -F M P
        -X 0 0 0 X 0 0 0
        0 -B -C -F 0 B -C F
        0 C N M 0 -C G -J
        0 -F -M P 0 F -J H
    """, """
        X = EA/L;
        B = 120EI/7L3;
        C = 60EI/7L2;
        F = 3EI/7L;
        G = 192EI/35L;
        H = 3EI L/35;
        J = 11EI/35;
        N = 108EI/35L;
        M = 4EI/35;
        P = EI L/70
    """),
    "F.1": matrix("""
        A 0 0 0 B 0 0 0
        0 D E F 0 G -H J
        0 E L M 0 H -N P
        0 F M Q 0 J -P W
        B 0 0 0 A 0 0 0
        0 G H J 0 D -E F
        0 -H -N -P 0 -E L -M
        0 J P W 0 F -M Q
    """, _MASS),
    "T F.1": matrix("""
        AC -DS -ES -FS BC -GS HS -JS
        AS DC EC FC BS GC -HC JC
        0 E L M 0 H -N P
        0 F M Q 0 J -P W
        BC -GS -HS -JS AC -DS ES -FS
        BS GC HC JC AS DC -EC FC
        0 -H -N -P 0 -E L -M
        0 J P W 0 F -M Q
    """, _MASS),
    "F.2": matrix("""
        AC2+DS2 ACS-DCS -ES -FS BC2+GS2 BCS-GCS HS -JS
        ACS-DCS AS2+DC2 EC FC BCS-GCS BS2+GC2 -HC JC
        -ES EC L M -HS HC -N P
        -FS FC M Q -JS JC -P W
        BC2+GS2 BCS-GCS -HS -JS AC2+DS2 ACS-DCS ES -FS
        BCS-GCS BS2+GC2 HC JC ACS-DCS AS2+DC2 -EC FC
        HS -HC -N -P ES -EC L -M
        -JS JC P W -FS FC -M Q
    """, _MASS),
    "F.3": matrix("""
        0 A B H 0 D -E F
        -A 0 0 0 -D 0 0 0
        -B 0 0 0 -E 0 0 0
        -H 0 0 0 -F 0 0 0
        0 D E F 0 A -B H
        -D 0 0 0 -A 0 0 0
        E 0 0 0 B 0 0 0
        -F 0 0 0 -H 0 0 0
    """, _TURNING),
    "T F.3": matrix("""
        AS AC BC HC DS DC -EC FC
        -AC AS BS HS -DC DS -ES FS
        -B 0 0 0 -E 0 0 0
        -H 0 0 0 -F 0 0 0
        DS DC EC FC AS AC -BC HC
        -DC DS ES FS -AC AS -BS HS
        E 0 0 0 B 0 0 0
        -F 0 0 0 -H 0 0 0
    """, _TURNING),
    "F.4": matrix("""
        0 AS2+AC2 BC HC 0 DS2+DC2 -EC FC
        -AC2-AS2 0 BS HS -DC2-DS2 0 -ES FS
        -BC -BS 0 0 -EC -ES 0 0
        -HC -HS 0 0 -FC -FS 0 0
        ? ? EC FC 0 AS2+AC2 -BC HC
        -DS2-DC2 0 ES FC -AC2-AS2 0 -BS HS
        EC ES 0 0 BC BS 0 0
        -FC -FS 0 0 -HC -HS 0 0
    """, _TURNING),
    "F.5": matrix("""
        A -B -D -E -F -H I -J
        B K L M H -N P -Q
        D L R U I -P V -Z
        E M U X J -Q Z Y
        -F -H -I -J A -B D -E
        H -N -P -Q B K -L M
        -I P V Z -D -L R -U
        J -Q -Z Y E M -U X
    """, _STIFFNESS),
    "T F.5": matrix("""
        AC-BS -BC-KS -DC-LS -EC-MS -FC-HS -HC+NS IC-PS -JC+QS
        AS+BC -BS+KC -DS+LC -ES+MC -FS+HC -HS+NC IS+PC -JS+QC
        D L R U I -P V -Z
        E M U X J -Q Z Y
        -FC-HS -HC+NS -IC+PS -JC+QS AC-BS -BC-KS DC+LS -EC-MS
        -FS+HC -HS-NC ? -JS-QC AS+BC -BS+KC DS-LC -ES+MC
        -I P V Z -D -L R -U
        J -Q -Z Y E M -U X
    """, _STIFFNESS),
    "F.6": matrix("""
        AC2+KS2 ACS-B-KCS -DC-LS -EC-MS -FC2-NS2 ? IC-PS -JC+QS
        ACS+B-KCS AS2+KC2 -DS+LC -ES+MC -FCS+H+NCS -FS2-NC2 IS+PC -JS-QC
        DC-LS DS+LC R U IC+PS IS-PC V -Z
        ? ES+MC U X JC+QS JS-QC Z Y
        -FC2-NS2 -FCS-H+NCS -IC+PS -JC+QS AC2+KS2 ACS-B-KCS DC+LS -EC-MS
        -FCS+H+NCS -FS2-NC2 -IS-PC -JS-QC ACS+B-KCS AS2+KC2 DS-LC -ES+MC
        -IC-PS -IS+PC V Z -DC+LS -DS-LC R -U
        JC+QS JS-QC -Z Y EC-MS ES+MC -U X
    """, _STIFFNESS),
    # of its three columns the signs are lost in the scan: sizes only
    "F.7": matrix("""
        YwL/2 pL/2 ?
        XwL/2 rL/2 aL2/7
        XwL2/10 rL2/10 4aL3/165
        XwL3/120 rL3/120 aL4/280
        YwL/2 pL/2 w2L2/3
        XwL/2 rL/2 5aL2/14
        XwL2/10 rL2/10 13aL3/210
        XwL3/120 rL3/120 aL4/210
    """),
    "F.8": matrix("AC-BS AS+BC D E FC-GS FS+GC H I", _LOAD),
}  # fmt: skip


#: Shape functions of u and w, by the number of the nodal unknown.
SHAPES = listed("""
    6.17 1 = -x/L
    6.18 5 = x/L
    6.23 2 = 1 - 10x3/L3 + 15x4/L4 - 6x5/L5
    6.24 3 = x - 6x3/L2 + 8x4/L3 - 3x5/L4
    6.25 4 = x2/2 - 3x2/2L + 3x4/2L2 - x5/2L3
    6.26 6 = 10x3/L3 - 15x4/L4 + 6x5/L5
    6.27 7 = -4x3/L2 + 7x4/L3 - 3x5/L4
    6.28 8 = x3/2L - x2/L2 + x5/2L3
    C.8 1 = 1 - x/L
    C.13 5 = x/L
    C.16 3 = x - 6x3/L2 + 8x4/L3 - 3x5/L4
    C.17 4 = x2/2 - 3x3/2L + 3x4/2L2 - x5/2L3
    B.X 2 = 1 - 10x3/L3 + 15x4/L4 - 6x5/L5
    B.X 3 = x - 6x3/L2 + 8x4/L3 - 3x5/L4
    B.X 4 = x2/2 - 3x3/2L + 3x4/2L2 - x5/2L3
    B.X 6 = 10x3/L3 - 15x4/L4 + 6x5/L5
    B.X 7 = -4x3/L2 + 7x4/L3 - 3x5/L4
    B.X 8 = x3/2L - x4/L2 + x5/2L3
""")
#: Products of two shape functions, by the numbers of their unknowns: of Appendix B's [A](x) and [M](x).
PRODUCTS = listed("""
    1 2 = 1 - x/L - 10x3/L3 + 25x4/L4 - 21x5/L5 + 6x6/L6
    1 3 = x - x2/L - 6x3/L2 + 14x4/L3 - 11x5/L4 + 3x6/L5
    1 4 = x2/2 - 2x3/L + 3x4/L2 - 2x5/L3 + x6/2L4
    1 6 = 10x3/L3 - 25x4/L4 + 21x5/L5 - 6x6/L6
    1 7 = -4x3/L2 + 11x4/L3 - 10x5/L4 + 3x6/L5
    1 8 = x3/2L - 3x4/2L2 + 3x5/2L3 - x6/2L4
    5 2 = x/L - 10x4/L4 + 15x5/L5 - 6x6/L6
    5 3 = x2/L - 6x4/L3 + 8x5/L4 - 3x6/L5
    5 4 = x3/2L - 3x4/2L2 + 3x5/2L3 - x6/2L4
    5 6 = 10x4/L4 - 15x5/L5 + 6x6/L6
    5 7 = -4x4/L3 + 7x5/L4 - 3x6/L5
    5 8 = x4/2L2 - x5/L3 + x6/2L4
    2 2 = ?
    2 3 = ?
    2 4 = x2/2 - 3x3/2L + 3x4/2L2 - 11x5/2L3 + 45x6/2L4 - 81x7/2L5 + 73x8/2L6 - 33x9/2L7 + 3x10/L8
    2 6 = 10x3/L3 - 15x4/L4 + 6x5/L5 - 100x6/L6 + 300x7/L7 - 345x8/L8 + 180x9/L9 - 36x10/L10
    2 7 = -4x3/L2 + 7x4/L3 - 3x5/L4 + 40x6/L5 - 130x7/L6 + 159x8/L7 - 87x9/L8 + 18x10/L9
    2 8 = x3/2L - x4/L2 + x5/2L3 - 5x6/L4 + 35x7/2L5 - 23x8/L6 + 27x9/2L7 - 3x10/L8
    3 2 = x - 6x3/L2 - 2x4/L3 + 12x5/L4 + 54x6/L5 - 170x7/L6 + 186x8/L7 - 93x9/L8 + 18x10/L9
    3 3 = x2 - 12x4/L2 + 16x5/L3 + 30x6/L4 - 96x7/L5 + 100x8/L6 - 48x9/L7 + 9x10/L8
    3 4 = x3/2 - 3x4/2L - 3x5/2L2 + 25x6/2L3 - 45x7/2L4 + 39x8/2L5 - 17x9/2L6 + 3x10/2L7
    3 6 = 10x4/L3 - 15x5/L4 - 54x6/L5 + 170x7/L6 - 186x8/L7 + 93x9/L8 - 18x10/L9
    3 7 = -4x4/L2 + 7x5/L3 + 21x6/L4 - 74x7/L5 + 86x8/L6 - 45x9/L7 + 9x10/L8
    3 8 = ?
    4 2 = x2/2 - 3x3/2L + 3x4/2L2 - 11x5/2L3 + 45x6/2L4 - 81x7/2L5 + 73x8/2L6 - 33x9/2L7 + 6x10/2L8
    4 3 = x3/2 - 3x4/2L - 3x5/2L2 + 25x6/2L3 - 45x7/2L4 + 39x8/2L5 - 17x9/2L6 + 3x10/2L7
    4 4 = x4/4 - 6x5/4L + 15x6/4L2 - 20x7/4L3 + 15x8/4L4 - 6x9/4L5 + x10/4L6
    4 6 = 10x5/2L3 - 45x6/2L4 + 81x7/2L5 - 73x8/2L6 + 33x9/2L7 - 6x10/2L8
    4 7 = -4x5/2L2 + 19x6/2L3 - 36x7/2L4 + 34x8/2L5 - 16x9/2L6 + 3x10/2L7
    4 8 = x5/4L - 5x6/4L2 + 10x7/4L3 - 10x8/4L4 + 5x9/4L5 - x10/4L6
    6 2 = 10x3/L3 - 15x4/L4 + 6x5/L5 - 100x6/L6 + 300x7/L7 - 345x8/L8 + 180x9/L9 - 36x10/L10
    6 3 = 10x4/L3 - 15x5/L4 - 54x6/L5 + 170x7/L6 - 186x8/L7 + 93x9/L8 - 18x10/L9
    6 4 = 10x5/2L3 - 45x6/2L4 + 81x7/2L5 - 73x8/2L6 + 33x9/2L7 - 6x10/2L8
    6 6 = 100x6/L6 - 300x7/L7 + 345x8/L8 - 180x9/L9 + 36x10/L10
    6 7 = -40x6/L5 + 130x7/L6 - 159x8/L7 + 87x9/L8 - 18x10/L9
    6 8 = 10x6/2L4 - 35x7/2L5 + 46x8/2L6 - 27x9/2L7 + 6x10/2L8
    7 2 = ?
    7 3 = -4x4/L2 + 7x5/L3 + 21x6/L4 - 74x7/L5 + 86x8/L6 - 45x9/L7 + 9x10/L8
    7 4 = -4x5/2L2 + 19x6/2L3 - 36x7/2L4 + 34x8/2L5 - 16x9/2L6 + 3x10/2L7
    7 6 = -40x6/L5 + 130x7/L6 - 159x8/L7 + 87x9/L8 - 18x10/L9
    7 7 = 16x6/L4 - 56x7/L5 + 73x8/L6 - 42x9/L7 + 9x10/L8
    7 8 = ?
    8 2 = x3/2L - x4/L2 + x5/2L3 - 10x6/2L4 + 35x7/2L5 - 46x8/2L6 + 27x9/2L7 - 6x10/2L8
    8 3 = x4/2L - x5/L2 - 5x6/2L3 + 20x7/2L4 - 25x8/2L5 + 14x9/2L6 - 3x10/2L7
    8 4 = x5/4L - 5x6/4L2 + 10x7/4L3 - 10x8/4L4 + 5x9/4L5 - x10/4L6
    8 6 = ?
    8 7 = -4x6/2L3 + 15x7/2L4 - 21x8/2L5 + 13x9/2L6 - 3x10/2L7
    8 8 = x6/4L2 - 2x7/2L3 + 6x8/4L4 - 2x9/2L5 + x10/4L6
""")
#: Powers of x times a shape function of w, by power and number: Appendix B's S, R, T, I, J, K.
MOMENTS = listed("""
    0 2 = 1 - 10x3/L3 + 15x4/L4 - 6x5/L5
    1 2 = x - 10x4/L3 + 15x5/L4 - 6x6/L5
    2 2 = x2 - 10x5/L3 + 15x6/L4 - 6x7/L5
    3 2 = x3 - 10x6/L3 + 15x7/L4 - 6x8/L5
    4 2 = x4 - 10x7/L3 + 15x8/L4 - 6x9/L5
    5 2 = x5 - 10x8/L3 + 15x9/L4 - 6x10/L5
    0 3 = x - 6x3/L2 + 8x4/L3 - 3x5/L4
    1 3 = x2 - 6x4/L2 + 8x5/L3 - 3x6/L4
    2 3 = x3 - 6x5/L2 + 8x6/L3 - 3x7/L4
    3 3 = x4 - 6x6/L2 + 8x7/L3 - 3x8/L4
    4 3 = x5 - 6x7/L2 + 8x8/L3 - 3x9/L4
    5 3 = x6 - 6x8/L2 + 8x9/L3 - 3x10/L4
    0 4 = x2/2 - 3x3/2L + 3x4/2L2 - x5/2L3
    1 4 = x3/2 - 3x4/2L + 3x5/2L2 - x6/2L3
    2 4 = x4/2 - 3x5/2L + 3x6/2L2 - x7/2L3
    3 4 = x5/2 - 3x6/2L + 3x7/2L2 - x8/2L3
    4 4 = x6/2 - 3x7/2L + 3x8/2L2 - x9/2L3
    5 4 = x7/2 - 3x8/2L + 3x9/2L2 - x10/2L3
    0 6 = 10x3/L3 - 15x4/L4 + 6x5/L5
    1 6 = ?
    2 6 = 10x5/L3 - 15x6/L4 + 6x7/L5
    3 6 = 10x6/L3 - 15x7/L4 + 6x8/L5
    4 6 = 10x7/L3 - 15x8/L4 + 6x9/L5
    5 6 = 10x8/L3 - 15x9/L4 + 6x10/L5
    0 7 = -4x3/L2 + 7x4/L3 - 3x5/L4
    1 7 = -4x4/L2 + 7x5/L3 - 3x6/L4
    2 7 = -4x5/L2 + 7x6/L3 - 3x7/L4
    3 7 = -4x6/L2 + 7x7/L3 - 3x8/L4
    4 7 = -4x7/L2 + 7x8/L3 - 3x9/L4
    5 7 = -4x8/L2 + 7x9/L3 - 3x10/L4
    0 8 = x3/2L - x4/L2 + x5/2L3
    1 8 = x4/2L - x5/L2 + x6/2L3
    2 8 = x5/2L - x6/L2 + x7/2L3
    3 8 = x6/2L - x7/L2 + x8/2L3
    4 8 = x7/2L - x8/L2 + x9/2L3
    5 8 = x8/2L - x9/L2 + x10/2L3
""")

#: Wrong entries as read, with their corrections: by matrix, row and column from 1, or by shape function.
#: The last three are of products that the final matrices F.4 and F.6 do not inherit, or of one letter.
ERRATA = {
    ("5.23", 8, 7): "-3/L4",
    ("B.14", 5, 3): "4L2/105",
    ("D.28", 1, 4): "0",
    ("F.7", 3, 3): "4aL3/105",
    ("T F.5", 2, 6): "-HS-NC",
    ("T F.5", 2, 8): "-JS-QC",
    ("F.4", 6, 4): "FS",
}
SHAPE_ERRATA = {
    "6.17 1": "1 - x/L",
    "6.25 4": "x2/2 - 3x3/2L + 3x4/2L2 - x5/2L3",
    "6.28 8": "x3/2L - x4/L2 + x5/2L3",
}
#: Sign of the letter X of F.5; it occurs at (4, 4) and (8, 8) of F.5, its product with T, and F.6.
LETTER_ERRATA = {"X": "3L EI/35 - w2L5/9240 m"}
