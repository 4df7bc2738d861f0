/* part: Two masses on springs. Their mean follows the force at once. */
/* Identity, variables and memory of the FMU, written by twin. */

#include "model.h"

enum {
    RECORD_SIZE = 288,
    FIELD_COUNT = 17,
    SLOT = SLOT_SIZE(RECORD_SIZE, FIELD_COUNT, 3),
};

#include "part.h"

_Static_assert(sizeof(part_t) == RECORD_SIZE, "the struct has the size of the record");

static void init(void *record) { part_init(record); }
static int32_t start(void *record, double t) { return part_start(record, t); }
static int32_t step(void *record, double t, double h) { return part_step(record, t, h); }
static int32_t derivatives(void *record, double t) { return part_derivatives(record, t); }
static int32_t tangent(void *record, void *tangents, double t, double tangent_of_t) { return part_tangent(record, tangents, t, tangent_of_t); }
static int32_t first_tangent(void *record, void *tangents, double t, double tangent_of_t) { return part_first_tangent(record, tangents, t, tangent_of_t); }

static const Field fields[FIELD_COUNT] = {
    [0]  = {.name = "f",         .offset = 0,   .count = 1, .type = FLOAT64, .access = SIGNAL},     /* [N] force */
    [1]  = {.name = "many",      .offset = 8,   .count = 1, .type = INT32,   .access = INPUT},      /* whole number */
    [2]  = {.name = "on",        .offset = 12,  .count = 1, .type = BOOLEAN, .access = INPUT},      /* whether it moves */
    [3]  = {.name = "mean",      .offset = 16,  .count = 1, .type = FLOAT64, .access = CALCULATED}, /* [m] mean position */
    [4]  = {.name = "energy",    .offset = 24,  .count = 1, .type = FLOAT64, .access = CALCULATED}, /* [J] of both */
    [5]  = {.name = "k[1]",      .offset = 104, .count = 1, .type = FLOAT64, .access = TUNABLE},    /* [N/m] stiffness */
    [6]  = {.name = "k[2]",      .offset = 112, .count = 1, .type = FLOAT64, .access = TUNABLE},    /* [N/m] stiffness */
    [7]  = {.name = "size",      .offset = 120, .count = 1, .type = FLOAT64, .access = FIXED},      /* [m] length at rest */
    [8]  = {.name = "x[1]",      .offset = 32,  .count = 1, .type = FLOAT64, .access = EXACT},      /* [m] positions */
    [9]  = {.name = "x[2]",      .offset = 40,  .count = 1, .type = FLOAT64, .access = EXACT},      /* [m] positions */
    [10] = {.name = "der(x[1])", .offset = 64,  .count = 1, .type = FLOAT64, .access = CALCULATED}, /* [m/s] derivative of x */
    [11] = {.name = "der(x[2])", .offset = 72,  .count = 1, .type = FLOAT64, .access = CALCULATED}, /* [m/s] derivative of x */
    [12] = {.name = "v[1]",      .offset = 48,  .count = 1, .type = FLOAT64, .access = EXACT},      /* [m/s] velocities */
    [13] = {.name = "v[2]",      .offset = 56,  .count = 1, .type = FLOAT64, .access = EXACT},      /* [m/s] velocities */
    [14] = {.name = "der(v[1])", .offset = 80,  .count = 1, .type = FLOAT64, .access = CALCULATED}, /* [m/s/s] derivative of v */
    [15] = {.name = "der(v[2])", .offset = 88,  .count = 1, .type = FLOAT64, .access = CALCULATED}, /* [m/s/s] derivative of v */
    [16] = {.name = "margin",    .offset = 96,  .count = 1, .type = FLOAT64, .access = CALCULATED}, /* [m] way to the stop */
};

static const double nominals[] = {0.5, 0.5, 1.0, 1.0};

static const int32_t states[] = {32, 40, 48, 56};

static const int32_t derivatives_of_states[] = {64, 72, 80, 88};

static const int32_t indicators[] = {96};

static _Alignas(64) unsigned char pool[(size_t)SLOT * SLOT_COUNT(SLOT)];

HIDDEN const Model model = {
    .name                  = "part",
    .token                 = "{00112233-4455-6677-8899-aabbccddeeff}",
    .identity              = {0x0011223344556677, 0x8899aabbccddeeff},
    .record_size           = RECORD_SIZE,
    .field_count           = FIELD_COUNT,
    .fields                = fields,
    .init                  = init,
    .start                 = start,
    .step                  = step,
    .derivatives           = derivatives,
    .tangent               = tangent,
    .first_tangent         = first_tangent,
    .substep               = 0.0001,
    .state_count           = 4,
    .states                = states,
    .derivatives_of_states = derivatives_of_states,
    .nominals              = nominals,
    .indicator_count       = 1,
    .indicators            = indicators,
    .pool                  = pool,
    .pool_size             = sizeof pool,
    .slot_size             = SLOT,
};
