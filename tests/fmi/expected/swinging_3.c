/* part: Two masses on springs. Their mean follows the force at once. */
/* Identity, variables and memory of the FMU, written by twin. */

#include "model.h"

enum {
    RECORD_SIZE = 288,
    FIELD_COUNT = 13,
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
    [0]  = {.name = "time",   .offset = TIME, .count = 1, .type = FLOAT64, .access = CALCULATED},                          /* [s] independent variable */
    [1]  = {.name = "f",      .offset = 0,    .count = 1, .type = FLOAT64, .access = SIGNAL, .is_intermediate = true},     /* [N] force */
    [2]  = {.name = "many",   .offset = 8,    .count = 1, .type = INT32,   .access = INPUT},                               /* whole number */
    [3]  = {.name = "on",     .offset = 12,   .count = 1, .type = BOOLEAN, .access = INPUT},                               /* whether it moves */
    [4]  = {.name = "mean",   .offset = 16,   .count = 1, .type = FLOAT64, .access = CALCULATED, .is_intermediate = true}, /* [m] mean position */
    [5]  = {.name = "energy", .offset = 24,   .count = 1, .type = FLOAT64, .access = CALCULATED, .is_intermediate = true}, /* [J] of both */
    [6]  = {.name = "k",      .offset = 104,  .count = 2, .type = FLOAT64, .access = TUNABLE},                             /* [N/m] stiffness */
    [7]  = {.name = "size",   .offset = 120,  .count = 1, .type = FLOAT64, .access = FIXED},                               /* [m] length at rest */
    [8]  = {.name = "x",      .offset = 32,   .count = 2, .type = FLOAT64, .access = EXACT},                               /* [m] positions */
    [9]  = {.name = "der(x)", .offset = 64,   .count = 2, .type = FLOAT64, .access = CALCULATED},                          /* [m/s] derivative of x */
    [10] = {.name = "v",      .offset = 48,   .count = 2, .type = FLOAT64, .access = EXACT},                               /* [m/s] velocities */
    [11] = {.name = "der(v)", .offset = 80,   .count = 2, .type = FLOAT64, .access = CALCULATED},                          /* [m/s/s] derivative of v */
    [12] = {.name = "margin", .offset = 96,   .count = 1, .type = FLOAT64, .access = CALCULATED},                          /* [m] way to the stop */
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
