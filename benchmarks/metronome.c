/* The bare loop: wakes at every multiple of a period by the monotonic clock, notes when, and does nothing else. On SIGTERM
 * it prints the times [ns].
 *
 *     metronome PERIOD_NS PHASE_NS PRIORITY      priority of SCHED_FIFO; 0: an ordinary process
 */
#define _GNU_SOURCE
#include <sched.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

enum { LONGEST = 1000000 };
static int64_t woken[LONGEST];
static volatile sig_atomic_t over;

static void end(int number) {
    (void)number;
    over = 1;
}

static int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

int main(int argc, char **argv) {
    if (argc != 4) return 2;
    int64_t period = atoll(argv[1]), due = now() / period * period + atoll(argv[2]);
    struct sched_param priority = {.sched_priority = atoi(argv[3])};
    if (priority.sched_priority) sched_setscheduler(0, SCHED_FIFO, &priority);
    mlockall(MCL_CURRENT | MCL_FUTURE);
    signal(SIGTERM, end);
    int count = 0;
    while (!over && count < LONGEST) {
        due += period;
        struct timespec t = {due / 1000000000, due % 1000000000};
        while (!over && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL)) {}
        if (!over) woken[count++] = now();
    }
    for (int i = 0; i < count; i++) printf("%lld\n", (long long)woken[i]);
}
