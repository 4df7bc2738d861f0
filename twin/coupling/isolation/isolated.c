/* Calls between the loop and an isolated member: both processes map the memory with these structs, at different addresses.
   So references in it are offsets from its begin, where the channel lies; 0 means none.

   Setters called by the loop only store values. A step is one call across: the member's process sets the stored values,
   steps, and reads the values that the loop read after the previous step. So a member costs one exchange per step.

   A call is a byte through a pipe, its return one through another: the reader sleeps, and end of file means that the other
   process has died. On one core that costs two context switches. Waking another core takes several times as long, most of
   all on a virtual machine, and the two never run at the same time: so the member follows the loop to its core. */

#include <stdbool.h>
#include <stdint.h>

enum { RETURN, STEP, GET, MESSAGE };
enum { OK, WARNING, DISCARD, ERROR };
enum { FMI3, FMI2, COMPONENT, NO_SIZE = -1 }; /* as in compiler/machine.py */

typedef int64_t __attribute__((aligned(1))) Word;
typedef int32_t (*Access)(void *instance, const void *references, uint64_t count, void *values, uint64_t size);
typedef int32_t (*Access2)(void *instance, const void *references, uint64_t count, void *values);
typedef int32_t (*Step)(void *instance, double t, double h, bool set, void *event, void *terminate, void *early, void *last);
typedef int32_t (*Step2)(void *instance, double t, double h, int32_t set);
typedef int32_t (*StepComponent)(void *instance, double t, double h);
typedef int64_t (*Transfer)(int file, void *bytes, uint64_t count);
typedef int (*Affinity)(int process, uint64_t size, const void *mask);

typedef struct { /* a call that moves values; function, instance and references are addresses in the member's process */
    void *function;
    void *instance;
    const void *references;
    int64_t count;
    int64_t values; /* offset */
    int64_t size;
    int64_t next; /* offset */
    int64_t bytes;
    int64_t write;
    int64_t pending; /* write: to be set before the next call; read: it was requested since the last step */
    int64_t fresh;   /* read: the values are current */
    int64_t status;
} Row;

typedef struct {
    int64_t call, called, back, returned; /* ends of the pipes: written, read, written, read */
    int64_t is_dead;
    int64_t status;
    int64_t wanted, at, rows; /* offsets of rows: to read; in progress, 0: the step; first of all */
    double t, h;
    char flags[32];
    void *step;
    int64_t signature;
    void *instance;
    Transfer read, write;         /* of the loop's process */
    Transfer own_read, own_write; /* of the member's process */
    Affinity set_affinity;        /* of the member's process */
    int64_t loop_core, own_core;  /* none: -1 */
    int64_t is_final;             /* no rollback to a time before the step's begin follows */
} Channel;

static void copy(char *target, const char *source, int64_t bytes) {
    int64_t i = 0;
    for (; i + 8 <= bytes; i += 8) *(Word *)(target + i) = *(const Word *)(source + i);
    for (; i < bytes; i++) target[i] = source[i];
}

static Row *row_at(Channel *c, int64_t offset) { return offset ? (Row *)((char *)c + offset) : 0; }

static char *values_of(Channel *c, Row *row) { return (char *)c + row->values; }

static void send(Transfer write, int64_t file, char what) { write((int)file, &what, 1); }

/* Receive a byte, retrying after signals. False: the other process has died. */
static bool receive(Transfer read, int64_t file, char *what) {
    int64_t count;
    while ((count = read((int)file, what, 1)) < 0) {}
    return count > 0;
}

static int32_t returned(Channel *c) {
    char what;
    if (c->is_dead) return ERROR;
    if (receive(c->read, c->returned, &what)) return (int32_t)c->status;
    c->is_dead = 1;
    return ERROR;
}

static int32_t call(Channel *c, char what) {
    if (!c->is_dead) send(c->write, c->call, what);
    return returned(c);
}

/* ------------------------------------------------------------------------------------------- called by the loop */

int32_t isolated_set(Channel *c, Row *row, uint64_t count, const char *values, uint64_t size) {
    copy(values_of(c, row), values, row->bytes);
    row->pending = 1;
    return c->is_dead ? ERROR : OK;
}

int32_t isolated_get(Channel *c, Row *row, uint64_t count, char *values, uint64_t size) {
    c->wanted = (char *)row - (char *)c;
    if (!row->fresh && call(c, GET) > WARNING) return (int32_t)c->status > WARNING ? (int32_t)c->status : ERROR;
    row->pending = 1;
    copy(values, values_of(c, row), row->bytes);
    return (int32_t)row->status;
}

/* A step in two halves, between which other members can step. */
void isolated_begin(Channel *c, double t, double h, bool is_final, char *event, char *terminate, char *early, char *last) {
    c->t = t;
    c->h = h;
    c->is_final = is_final;
    char *own[] = {event, terminate, early, last};
    for (int i = 0; i < 4; i++) copy(c->flags + 8 * i, own[i], 8);
    if (!c->is_dead) send(c->write, c->call, STEP);
}

int32_t isolated_end(Channel *c, double t, double h, bool is_final, char *event, char *terminate, char *early, char *last) {
    char *own[] = {event, terminate, early, last};
    int32_t status = returned(c);
    for (int i = 0; i < 4; i++) copy(own[i], c->flags + 8 * i, 8);
    return status;
}

int32_t isolated_step(Channel *c, double t, double h, bool is_final, char *event, char *terminate, char *early, char *last) {
    isolated_begin(c, t, h, is_final, event, terminate, early, last);
    return isolated_end(c, t, h, is_final, event, terminate, early, last);
}

void isolated_tell(Channel *c) { send(c->write, c->call, MESSAGE); }

/* ----------------------------------------------------------------------------------- called in the member's process */

static int32_t access(Channel *c, Row *row) {
    char *values = values_of(c, row);
    c->at = (char *)row - (char *)c;
    row->status = row->size == NO_SIZE
                      ? ((Access2)row->function)(row->instance, row->references, row->count, values)
                      : ((Access)row->function)(row->instance, row->references, row->count, values, row->size);
    c->at = 0;
    return (int32_t)row->status;
}

static int32_t set(Channel *c) {
    int32_t status = OK;
    for (Row *row = row_at(c, c->rows); row && status <= WARNING; row = row_at(c, row->next))
        if (row->write && row->pending) {
            row->pending = 0;
            status = access(c, row);
        }
    return status;
}

static void follow(Channel *c) {
    uint64_t mask[16] = {0};
    if (c->own_core == c->loop_core) return;
    c->own_core = c->loop_core;
    mask[c->own_core / 64 % 16] = 1ull << c->own_core % 64;
    c->set_affinity(0, sizeof mask, mask); /* if that is forbidden, calls only take longer */
}

static int32_t call_step(Channel *c) {
    if (c->signature == COMPONENT) return ((StepComponent)c->step)(c->instance, c->t, c->h);
    if (c->signature == FMI2) return ((Step2)c->step)(c->instance, c->t, c->h, (int32_t)c->is_final);
    return ((Step)c->step)(c->instance, c->t, c->h, c->is_final, c->flags, c->flags + 8, c->flags + 16, c->flags + 24);
}

static int32_t step(Channel *c) {
    follow(c);
    int32_t status = set(c);
    if (status <= WARNING)
        status = call_step(c);
    for (Row *row = row_at(c, c->rows); row; row = row_at(c, row->next))
        if (!row->write) {
            row->fresh = row->pending && status <= WARNING;
            row->pending = 0;
            if (row->fresh) access(c, row);
        }
    return status;
}

static int32_t get(Channel *c) {
    int32_t status = set(c);
    return status <= WARNING ? access(c, row_at(c, c->wanted)) : status;
}

/* Process calls of the loop until there is a message (true) or the loop's process has ended (false). */
int32_t isolated_serve(Channel *c) {
    for (char what; receive(c->own_read, c->called, &what); send(c->own_write, c->back, RETURN)) {
        if (what == MESSAGE) {
            set(c);
            for (Row *row = row_at(c, c->rows); row; row = row_at(c, row->next)) row->fresh = 0;
            return true;
        }
        c->status = what == STEP ? step(c) : get(c);
    }
    return false;
}

/* Copy the values of a record, which lie in `count` pieces: address and size [byte] of each. */
int32_t isolated_gather(void *instance, const int64_t *pieces, uint64_t count, char *values, uint64_t size) {
    for (; count--; values += pieces[1], pieces += 2) copy(values, (const char *)pieces[0], pieces[1]);
    return OK;
}

int32_t isolated_scatter(void *instance, const int64_t *pieces, uint64_t count, const char *values, uint64_t size) {
    for (; count--; values += pieces[1], pieces += 2) copy((char *)pieces[0], values, pieces[1]);
    return OK;
}
