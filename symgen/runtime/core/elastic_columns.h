/* Order of the numbers that elastic kernels write and the core reads.
 * Written by `symgen generate` from symgen/models/elastic/columns.py. */
#ifndef SYMGEN_ELASTIC_COLUMNS_H
#define SYMGEN_ELASTIC_COLUMNS_H

/* a row of the kernel `links`: direction of the link, and weights of its constants, of which those
 * of the inertia of the elastic motion come first. */
enum {
    COSINE, SINE, DAMPING_GYROSCOPIC, DAMPING_MASS_QUARTER, STIFFNESS_CENTRIFUGAL, STIFFNESS_DAMPING_QUARTER,
    STIFFNESS_GYROSCOPIC, STIFFNESS_GYROSCOPIC_QUARTER, STIFFNESS_MASS_ENDS, STIFFNESS_MASS_QUARTER, LOAD_OUT,
    LOAD_TURN, LOAD_X, LOAD_Y, STIFFNESS_GEOMETRIC0, STIFFNESS_GEOMETRIC1, STIFFNESS_GEOMETRIC2, MOTION
};
#define MOTION_NAMES \
    "cosine sine damping_gyroscopic damping_mass_quarter stiffness_centrifugal stiffness_damping_quarter " \
    "stiffness_gyroscopic stiffness_gyroscopic_quarter stiffness_mass_ends stiffness_mass_quarter " \
    "load_out load_turn load_x load_y stiffness_geometric0 stiffness_geometric1 stiffness_geometric2"

/* a row of the kernel `loads`: weights of a force along a link. */
enum {
    LOAD_FORCE_X, LOAD_FORCE_Y, STIFFNESS_FOLLOWER_X, STIFFNESS_FOLLOWER_Y, STIFFNESS_GEOMETRIC_FORCE, APPLIED
};
#define APPLIED_NAMES \
    "load_force_x load_force_y stiffness_follower_x stiffness_follower_y stiffness_geometric_force"

/* the kernel `shaft`: terms of the rotation of an elastic crank with a motor. */
enum {
    SHAFT_MASS, SHAFT_DAMPING, SHAFT_STIFFNESS, SHAFT_LOAD, SHAFT
};
#define SHAFT_NAMES \
    "shaft_mass shaft_damping shaft_stiffness shaft_load"

/* blocks of the kernel `joints`. */
enum {
    BLOCK_LOAD, BLOCK_MASS_MATRIX, BLOCK_DAMPING, BLOCK_STIFFNESS, BLOCK_JACOBIAN, BLOCK_JACOBIAN_RATE,
    BLOCK_JACOBIAN_SECOND_RATE, BLOCKS
};
#define BLOCKS_NAMES \
    "load mass_matrix damping stiffness jacobian jacobian_rate jacobian_second_rate"

/* matrices of a superelement, n x n each. */
enum {
    OF_MASS, OF_CENTRIFUGAL, OF_GYROSCOPIC, OF_STIFFNESS, OF_DAMPING, OF_AXIAL0, OF_AXIAL1, OF_AXIAL2, MATRICES
};
#define MATRICES_NAMES \
    "mass centrifugal gyroscopic stiffness damping axial0 axial1 axial2"

/* vectors of a superelement behind its matrices, n each. */
enum {
    OF_LOAD_X, OF_LOAD_Y, OF_LOAD_OUT, OF_LOAD_TURN, VECTORS
};
#define VECTORS_NAMES \
    "load_x load_y load_out load_turn"

/* of a force along a link behind them: two vectors and three matrices. */
enum {
    OF_FORCE_X, OF_FORCE_Y, OF_FORCE_AXIAL, OF_FOLLOWER_X, OF_FOLLOWER_Y, SPREAD
};
#define SPREAD_NAMES \
    "force_x force_y force_axial follower_x follower_y"

#endif
