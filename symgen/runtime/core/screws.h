/* Closure twist and powers from the screws of joints, for one loop or for lanes of loops: the including file defines
   NUMBER and LOOP. */

/* Write the twist that closes the loop to first order: minus the small rotation, and the displacement at O. */
static void mismatch(const LOOP *l, NUMBER *b) {
    const NUMBER *e = l->screws;
    const NUMBER x = R(0.5) * (e[9] - e[6]), y = R(0.5) * (e[2] - e[8]), z = R(0.5) * (e[4] - e[1]);
    b[0] = -x;
    b[1] = -y;
    b[2] = -z;
    b[3] = -e[3] + y * e[11] - z * e[7];
    b[4] = -e[7] + z * e[3] - x * e[11];
    b[5] = -e[11] + x * e[7] - y * e[3];
}

/* The reciprocal product of variable j's screw with a wrench (force, moment). */
static NUMBER power(const LOOP *l, long j, const NUMBER *w) {
    const long n = l->sizes.n;
    NUMBER total = {0};
    for (int i = 0; i < 3; i++)
        total += l->screws[12 + n * i + j] * w[3 + i] + l->screws[12 + n * (3 + i) + j] * w[i];
    return total;
}
