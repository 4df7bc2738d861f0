/* Steps of several members at the same time. A block is the members that an operation of the loop steps one after the
   other, all with their inputs set already. The loop calls `block_step` in place of each member's step: the call for the
   first member steps the whole block and waits for its end, the others return what their member's step returned.

   Members in processes of their own are told to step first and waited for last. The others are claimed one by one by
   the loop's thread and the workers. A thread spins for a while, since the next block may follow soon, and then waits for
   a condition variable: a write to a pipe would wake it on the writer's core, where the two do not run at the same time. */

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

enum { OK, WARNING, DISCARD, ERROR };
enum { FMI3, FMI2, COMPONENT }; /* as in compiler/machine.py */
enum { MEASURE_SERIAL, MEASURE, RUN }; /* modes of a block: step one by one, at the same time, also without measuring */
enum { SPINS = 2000, NANO = 1000000000 };

typedef int32_t (*Step)(void *instance, double t, double h, bool set, void *event, void *terminate, void *early, void *last);
typedef int32_t (*Step2)(void *instance, double t, double h, int32_t set);
typedef int32_t (*StepComponent)(void *instance, double t, double h);
typedef void (*Begin)(void *instance, double t, double h, bool set, void *event, void *terminate, void *early, void *last);
typedef int (*Lock)(void *mutex);
typedef int (*Wait)(void *condition, void *mutex);
typedef int32_t (*Clock)(int32_t clock, int64_t *time);

typedef struct {
    Lock pthread_mutex_lock, pthread_mutex_unlock, pthread_cond_broadcast;
    Wait pthread_cond_wait;
    Clock clock_gettime;
    int64_t clock;           /* identifier of the monotonic clock */
    void *mutex;
    void *start, *end;       /* conditions that the workers and the loop wait for */
    int64_t *at;             /* the loop's word about the call in progress, for crash reports */
    _Atomic(struct Block *) block;
    atomic_llong generation; /* number of blocks begun */
    atomic_llong waiting;    /* workers that wait */
    atomic_llong loop_waits;
    atomic_llong is_over;
} Pool;

typedef struct Task {
    struct Block *block;
    void *function;
    int64_t signature;
    void *instance;
    char *flags;
    Begin begin; /* of a member in another process: sends the step, whose end `function` waits for */
    int64_t status;
    int64_t calls, least; /* of measured steps: number, and the shortest time [ns] */
} Task;

typedef struct Block {
    Pool *pool;
    Task *tasks; /* those of this process come first */
    int64_t count, local_count;
    int64_t mode;
    double t, h;
    int64_t is_final;
    Task *first;
    atomic_llong next, pending;
} Block;

static void pause_briefly(void) {
#if defined(__x86_64__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    __asm__ volatile("yield");
#endif
}

static int32_t step(Task *task) {
    Block *b = task->block;
    char *f = task->flags;
    if (task->signature == COMPONENT) return ((StepComponent)task->function)(task->instance, b->t, b->h);
    if (task->signature == FMI2) return ((Step2)task->function)(task->instance, b->t, b->h, (int32_t)b->is_final);
    return ((Step)task->function)(task->instance, b->t, b->h, b->is_final, f, f + 8, f + 16, f + 24);
}

static void begin(Task *task) {
    Block *b = task->block;
    char *f = task->flags;
    task->begin(task->instance, b->t, b->h, b->is_final, f, f + 8, f + 16, f + 24);
}

static void notify(Pool *p, void *condition) {
    p->pthread_mutex_lock(p->mutex);
    p->pthread_cond_broadcast(condition);
    p->pthread_mutex_unlock(p->mutex);
}

static int64_t now(Pool *p) {
    int64_t time[2];
    p->clock_gettime((int32_t)p->clock, time);
    return time[0] * NANO + time[1];
}

static int32_t measure(Pool *p, Task *task) {
    int64_t begun = now(p);
    if (task->begin) begin(task);
    int32_t status = step(task);
    int64_t time = now(p) - begun;
    if (task->calls++ == 0 || time < task->least) task->least = time;
    return status;
}

/* Step the members of a block that no other thread has claimed. */
static void work(Pool *p, Block *b) {
    int64_t i;
    while ((i = atomic_fetch_add(&b->next, 1)) < b->local_count) {
        Task *task = &b->tasks[i];
        task->status = b->mode == RUN ? step(task) : measure(p, task);
        if (atomic_fetch_sub(&b->pending, 1) == 1 && atomic_load(&p->loop_waits)) notify(p, p->end);
    }
}

static void wait_for_block(Pool *p, int64_t seen) {
    for (int i = 0; i < SPINS; i++) {
        if (atomic_load(&p->generation) != seen) return;
        pause_briefly();
    }
    p->pthread_mutex_lock(p->mutex);
    atomic_fetch_add(&p->waiting, 1);
    while (atomic_load(&p->generation) == seen) p->pthread_cond_wait(p->start, p->mutex);
    atomic_fetch_sub(&p->waiting, 1);
    p->pthread_mutex_unlock(p->mutex);
}

static void wait_for_workers(Pool *p, Block *b) {
    for (int i = 0; i < SPINS; i++) {
        if (atomic_load(&b->pending) == 0) return;
        pause_briefly();
    }
    p->pthread_mutex_lock(p->mutex);
    atomic_store(&p->loop_waits, 1);
    while (atomic_load(&b->pending) > 0) p->pthread_cond_wait(p->end, p->mutex);
    atomic_store(&p->loop_waits, 0);
    p->pthread_mutex_unlock(p->mutex);
}

static void wake(Pool *p, Block *b) {
    atomic_store(&p->block, b);
    atomic_fetch_add(&p->generation, 1);
    if (atomic_load(&p->waiting) > 0) notify(p, p->start);
}

static void step_all(Pool *p, Block *b) {
    for (int64_t i = b->local_count; i < b->count; i++) begin(&b->tasks[i]);
    *p->at = (int64_t)(intptr_t)b;
    if (b->local_count > 0) {
        atomic_store(&b->pending, b->local_count);
        atomic_store(&b->next, 0);
        if (b->local_count > 1) wake(p, b);
        work(p, b);
        wait_for_workers(p, b);
    }
    for (int64_t i = b->local_count; i < b->count; i++) b->tasks[i].status = step(&b->tasks[i]);
}

/* Called by the loop in place of a member's step; the flags are those of the task. */
int32_t block_step(Task *task, double t, double h, bool is_final) {
    Block *b = task->block;
    if (task == b->first || b->mode == MEASURE_SERIAL) b->t = t, b->h = h, b->is_final = is_final;
    if (b->mode == MEASURE_SERIAL) return measure(b->pool, task);
    if (task == b->first) step_all(b->pool, b);
    return (int32_t)task->status;
}

/* Body of a worker thread, until `block_end`. */
int32_t block_work(Pool *p) {
    for (int64_t seen = 0; !atomic_load(&p->is_over);) {
        wait_for_block(p, seen);
        seen = atomic_load(&p->generation);
        Block *b = atomic_load(&p->block);
        if (b) work(p, b);
    }
    return OK;
}

void block_end(Pool *p) {
    atomic_store(&p->is_over, 1);
    wake(p, 0);
}
