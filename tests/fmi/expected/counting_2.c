/* part: Counts "ticks" <of> 5 ms & more. */
/* Identity, variables and memory of the FMU, written by twin. */

#include "model.h"

enum {
    RECORD_SIZE = 104,
    FIELD_COUNT = 6,
    SLOT = SLOT_SIZE(RECORD_SIZE, FIELD_COUNT, 1),
};

#include "part.h"

_Static_assert(sizeof(part_t) == RECORD_SIZE, "the struct has the size of the record");

static void init(void *record) { part_init(record); }
static int32_t start(void *record, double t) { return part_start(record, t); }
static int32_t step(void *record, double t, double h) { return part_step(record, t, h); }

static const Field fields[FIELD_COUNT] = {
    [0] = {.name = "reset", .offset = 0,  .count = 1, .type = BOOLEAN, .access = INPUT},      /* sets it to zero */
    [1] = {.name = "u[1]",  .offset = 8,  .count = 1, .type = FLOAT64, .access = INPUT},      /* [V] voltage */
    [2] = {.name = "u[2]",  .offset = 16, .count = 1, .type = FLOAT64, .access = INPUT},      /* [V] voltage */
    [3] = {.name = "ticks", .offset = 24, .count = 1, .type = INT64,   .access = CALCULATED}, /* ticks so far */
    [4] = {.name = "high",  .offset = 32, .count = 1, .type = BOOLEAN, .access = CALCULATED}, /* whether the voltage is high */
    [5] = {.name = "limit", .offset = 48, .count = 1, .type = FLOAT64, .access = TUNABLE},    /* [V] limit? */
};

static _Alignas(64) unsigned char pool[(size_t)SLOT * SLOT_COUNT(SLOT)];

HIDDEN const Model model = {
    .name          = "part",
    .token         = "{00112233-4455-6677-8899-aabbccddeeff}",
    .identity      = {0x0011223344556677, 0x8899aabbccddeeff},
    .record_size   = RECORD_SIZE,
    .field_count   = FIELD_COUNT,
    .fields        = fields,
    .init          = init,
    .start         = start,
    .step          = step,
    .derivatives   = NULL,
    .tangent       = NULL,
    .first_tangent = NULL,
    .period        = 5000000,
    .begin         = 56,
    .tick          = 64,
    .pool          = pool,
    .pool_size     = sizeof pool,
    .slot_size     = SLOT,
};
