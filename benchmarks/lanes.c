/* Sheath, wall and guided tip with a patient in each lane of vectors: what benchmarks/lanes.py compares with the same
   written by the translator for one patient. Branches become selections: both sides are computed. */

typedef double real __attribute__((ext_vector_type(LANES)));
typedef long mask __attribute__((ext_vector_type(LANES)));

#define COUNT(array) ((int)(sizeof(array) / sizeof((array)[0])))

static inline real pick(mask chosen, real a, real b)
{
    return (real)(((mask)a & chosen) | ((mask)b & ~chosen));
}

static inline real all(double value)
{
    return (real)value;
}

static inline real absolute(real a)
{
    return __builtin_elementwise_abs(a);
}

/* fmus/instruments/sheath/model.py */

static real beyond(real value, real limit)
{
    return pick(absolute(value) <= limit, all(0.0), value - __builtin_elementwise_copysign(limit, value));
}

typedef struct {
    real gripper, contact;
    real stiffness[3], play[3], friction[3], wrap[3], drag[3], coefficient;
    real position[3], speed[3], thrust[4];
} sheath;

static void sheath_slopes(sheath *s)
{
    real upstream = s->gripper;
    for (int i = 0; i < 3; i++) {
        s->thrust[i] = s->stiffness[i] * beyond(upstream - s->position[i], 0.5 * s->play[i]);
        upstream = s->position[i];
    }
    s->thrust[3] = s->contact;
    for (int i = 0; i < 3; i++) {
        const real normal = s->wrap[i] * 0.5 * (absolute(s->thrust[i]) + absolute(s->thrust[i + 1]));
        const real limit = s->friction[i] + s->coefficient * normal;
        s->speed[i] = beyond(s->thrust[i] - s->thrust[i + 1], limit) / s->drag[i];
    }
}

/* fmus/instruments/wall/model.py */

typedef struct {
    real tip, heart;
    real stiffness, length, surface, radius, modulus, dissipation, drag;
    real indentation, speed, load, force, displacement;
} wall;

static void wall_slopes(wall *s)
{
    const real zero = all(0.0);
    const real bending = 3.0 * s->stiffness / (s->length * s->length * s->length);
    const real approach = s->tip - s->heart - s->surface;
    s->load = bending * (approach - s->indentation);
    const real depth = pick(zero > s->indentation, zero, s->indentation);
    const real elastic = 4.0 / 3.0 * s->modulus * __builtin_elementwise_sqrt(s->radius * depth) * depth;
    s->force = pick(zero > s->load, zero, s->load);
    s->displacement = -s->force / bending;
    const mask apart = (s->load < zero) & (s->indentation <= zero);
    s->speed = pick(apart, zero, (s->load - elastic) / (s->dissipation * elastic + s->drag));
}

/* Runge-Kutta of order 4, as twin/component/solver.py has it, ten substeps of 0.1 ms. */
#define STEP(kind, states, rates)                                                               \
    static void step_##kind(kind *s)                                                            \
    {                                                                                           \
        const double h = 1e-4, nodes[4] = {0.0, 0.5, 0.5, 1.0};                                 \
        const double weights[4] = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};                 \
        enum { size = sizeof(states) / sizeof(real) };                                          \
        real *const x = (real *)&(states), *const dx = (real *)&(rates);                        \
        for (int n = 0; n < 10; n++) {                                                          \
            real x0[size], k[4][size];                                                          \
            for (int j = 0; j < size; j++) {                                                    \
                x0[j] = x[j];                                                                   \
            }                                                                                   \
            for (int i = 0; i < 4; i++) {                                                       \
                for (int j = 0; j < size; j++) {                                                \
                    x[j] = i ? x0[j] + h * (nodes[i] * k[i - 1][j]) : x0[j];                    \
                }                                                                               \
                kind##_slopes(s);                                                               \
                for (int j = 0; j < size; j++) {                                                \
                    k[i][j] = dx[j];                                                            \
                }                                                                               \
            }                                                                                   \
            for (int j = 0; j < size; j++) {                                                    \
                real change = all(0.0);                                                         \
                for (int m = 0; m < 4; m++) {                                                   \
                    change += weights[m] * k[m][j];                                             \
                }                                                                               \
                x[j] = x0[j] + h * change;                                                      \
            }                                                                                   \
        }                                                                                       \
        kind##_slopes(s);                                                                       \
    }

STEP(sheath, s->position, s->speed)
STEP(wall, s->indentation, s->speed)

/* fmus/instruments/guided_tip/model.py, with its 38 gratings */

enum { GRATINGS = 38, SEGMENTS = 6 };

typedef struct {
    real travel[3], displacement[2], pitch, grating, blend, free;
    real support[3], begin[SEGMENTS], across[SEGMENTS][2];
    real curvature[GRATINGS][2], shape[GRATINGS + 1][3], tangent[GRATINGS + 1][3], frame[4][3];
} tip;

static real carried(const tip *s, real location)
{
    real found = s->travel[2];
    for (int i = 2; i > 0; i--) {
        const real before = s->support[i - 1], part = (location - before) / (s->support[i] - before);
        found = pick(location < s->support[i], s->travel[i - 1] + part * (s->travel[i] - s->travel[i - 1]), found);
    }
    return pick(location <= s->support[0], s->travel[0], found);
}

static real risen(real distance, real blend)
{
    const real over = distance + 0.5 * blend;
    const real found = pick(distance >= 0.5 * blend, distance, 0.5 * over * over / blend);
    return pick(distance <= -0.5 * blend, all(0.0), found);
}

static void path_curvature(const tip *s, real location, real length, real *k)
{
    const real half = 0.5 * length, reach = half + 0.5 * s->blend;
    k[0] = k[1] = all(0.0);
    mask behind = location == location;
    for (int i = 0; i < SEGMENTS; i++) {
        const real distance = location - s->begin[i];
        behind &= ~(distance <= -reach);
        int any = 0;
        for (int j = 0; j < LANES; j++) {
            any |= behind[j] != 0;
        }
        if (!any) {
            break;
        }
        const real part = (risen(distance + half, s->blend) - risen(distance - half, s->blend)) / length;
        const real share = pick(distance < reach, part, all(1.0));
        k[0] = pick(behind, k[0] + share * s->across[i][0], k[0]);
        k[1] = pick(behind, k[1] + share * s->across[i][1], k[1]);
    }
}

static real overhung(const tip *s, real left)
{
    const real size = 6.0 / ((2.0 * s->free + s->blend) * (s->free + s->blend));
    const real rest = left - s->free, inside = pick(s->blend < rest, s->blend, rest);
    const real blended = size * (0.5 * s->free + inside - inside * inside / (2.0 * s->blend));
    return pick(left <= s->free, size * left * left / (2.0 * s->free), blended);
}

static void bent(const tip *s, real location, real length, real *k)
{
    path_curvature(s, location + carried(s, location), length, k);
    const real left = (double)GRATINGS * s->pitch - location;
    const mask ends = left - 0.5 * length < s->free + s->blend;
    int any = 0;
    for (int j = 0; j < LANES; j++) {
        any |= ends[j] != 0;
    }
    if (any) {
        const real below = left - 0.5 * length;
        const real each = (overhung(s, left + 0.5 * length) - overhung(s, pick(all(0.0) > below, all(0.0), below))) / length;
        k[0] = pick(ends, k[0] + each * s->displacement[0], k[0]);
        k[1] = pick(ends, k[1] + each * s->displacement[1], k[1]);
    }
}

static void advance_frame(real frame[4][3], const real *k, real h)
{
    const real square = (k[0] * k[0] + k[1] * k[1]) * h * h;
    const mask straight = square == all(0.0);
    const real sine = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0));
    const real versine = 0.5 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)));
    const real cosine = 1.0 - square * versine;
    for (int j = 0; j < 3; j++) {
        const real tangent = frame[2][j];
        const real bend = h * (k[0] * frame[0][j] + k[1] * frame[1][j]);
        const real turn = versine * bend + sine * tangent;
        frame[3][j] += pick(straight, h * tangent, h * (sine * tangent + versine * bend));
        frame[0][j] -= k[0] * h * turn;
        frame[1][j] -= k[1] * h * turn;
        frame[2][j] = pick(straight, tangent, cosine * tangent + sine * bend);
    }
}

static void put_node(tip *s, int i)
{
    for (int j = 0; j < 3; j++) {
        s->shape[i][j] = s->frame[3][j];
        s->tangent[i][j] = s->frame[2][j];
    }
}

static void step_tip(tip *s)
{
    real k[2];
    for (int i = 0; i < GRATINGS; i++) {
        bent(s, ((double)i + 0.5) * s->pitch, s->grating, s->curvature[i]);
    }
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 3; j++) {
            s->frame[i][j] = all(i == j ? 1.0 : 0.0);
        }
    }
    /* one step to the base: travels here are below a pitch */
    path_curvature(s, 0.5 * s->travel[0], s->pitch, k);
    advance_frame(s->frame, k, s->travel[0]);
    put_node(s, 0);
    const real part = s->pitch / 2.0;
    for (int i = 0; i < GRATINGS; i++) {
        for (int n = 0; n < 2; n++) {
            bent(s, (double)i * s->pitch + ((double)n + 0.5) * part, part, k);
            advance_frame(s->frame, k, part);
        }
        put_node(s, i + 1);
    }
}

/* Patients that differ; the same numbers are given to what the translator wrote. */

#include <math.h>
#include <stdio.h>
#include <time.h>

#ifdef WRITTEN
#include "guided_tip.h"
#include "sheath.h"
#include "wall.h"
#endif

enum { PATIENTS = 16, STEPS = 2000, REPEATS = 5 };

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static double heart[PATIENTS][STEPS], gripper[PATIENTS][STEPS];

static double factor(int patient)
{
    return 1.0 + 0.02 * patient;
}

static void prepare(void)
{
    for (int p = 0; p < PATIENTS; p++) {
        for (int n = 0; n < STEPS; n++) {
            heart[p][n] = 5e-3 * sin(6.283 * factor(p) * 1e-3 * n);
            gripper[p][n] = 5e-3 * sin(6.283 * factor(p) * 1e-3 * (n - 40.0));
        }
    }
}

#ifdef WRITTEN
static sheath_t a[PATIENTS];
static wall_t b[PATIENTS];
static guided_tip_t c[PATIENTS];

static void begin(int p)
{
    sheath_init(&a[p]);
    wall_init(&b[p]);
    guided_tip_init(&c[p]);
    for (int i = 0; i < 3; i++) {
        a[p].friction[i] *= factor(p);
        a[p].play[i] *= factor(p);
    }
    b[p].wall_modulus *= factor(p);
    a[p].gripper_position = gripper[p][0];
    sheath_start(&a[p], 0.0);
    wall_start(&b[p], 0.0);
    guided_tip_start(&c[p], 0.0);
}

static void part(int which, int p, int n, double *sums)
{
    const double t = 1e-3 * n;
    if (which != 1 && which != 2) {
        a[p].gripper_position = gripper[p][n];
        a[p].contact_force = b[p].force;
        sheath_step(&a[p], t, 1e-3);
    }
    if (which != 0 && which != 2) {
        b[p].heart_position = heart[p][n];
        b[p].tip_position = which == 1 ? gripper[p][n] : a[p].tip_position;
        wall_step(&b[p], t, 1e-3);
    }
    if (which != 0 && which != 1) {
        for (int i = 0; i < 3; i++) {
            c[p].travel[i] = which == 2 ? gripper[p][n] : a[p].position[i];
        }
        c[p].displacement[1] = b[p].displacement;
        guided_tip_step(&c[p], t, 1e-3);
    }
    sums[p] += b[p].force + a[p].tip_position + c[p].tip_position[0] + c[p].tip_position[2];
}
#else
static sheath a[PATIENTS / LANES];
static wall b[PATIENTS / LANES];
static tip c[PATIENTS / LANES];

static void begin(int g)
{
    static const double stiffness[3] = {2200.0, 12000.0, 12000.0}, friction[3] = {0.6, 0.8, 0.8};
    static const double play[3] = {0.0, 0.0003, 0.0003}, drag[3] = {6.0, 3.0, 3.0};
    static const double wrap[3] = {0.0, 1.5707963267948966, 1.5707963267948966};
    static const double length[6] = {0.203, 0.0785, 0.0785, 1.0, 1.0, 1.0}, bend[6] = {0.0, 20.0, 20.0, 0.0, 0.0, 0.0};
    static const double angle[6] = {0.0, 0.0, 3.141592653589793, 0.0, 0.0, 0.0}, support[3] = {0.203, 0.2815, 0.36};
    real own = all(0.0);
    a[g] = (sheath){.coefficient = all(0.15)};
    b[g] = (wall){all(0.0), all(0.0), all(0.00043), all(0.048), all(-0.0183), all(0.00133), all(105000.0), all(8.0), all(0.1)};
    c[g] = (tip){.pitch = all(0.01), .grating = all(0.005), .blend = all(0.015), .free = all(0.02)};
    for (int j = 0; j < LANES; j++) {
        own[j] = factor(g * LANES + j);
    }
    for (int i = 0; i < 3; i++) {
        a[g].stiffness[i] = all(stiffness[i]);
        a[g].friction[i] = friction[i] * own;
        a[g].play[i] = play[i] * own;
        a[g].drag[i] = all(drag[i]);
        a[g].wrap[i] = all(wrap[i]);
        c[g].support[i] = all(support[i]);
        for (int j = 0; j < LANES; j++) {
            a[g].position[i][j] = gripper[g * LANES + j][0];
        }
    }
    b[g].modulus *= own;
    double at = 0.0, before[2] = {0.0, 0.0};
    for (int i = 0; i < SEGMENTS; i++) {
        const double k[2] = {bend[i] * cos(angle[i]), bend[i] * sin(angle[i])};
        c[g].begin[i] = all(at);
        at += length[i];
        for (int j = 0; j < 2; j++) {
            c[g].across[i][j] = all(k[j] - before[j]);
            before[j] = k[j];
        }
    }
    a[g].gripper = a[g].position[0];
    sheath_slopes(&a[g]);
    wall_slopes(&b[g]);
    step_tip(&c[g]);
}

static real given(double table[PATIENTS][STEPS], int g, int n)
{
    real found;
    for (int j = 0; j < LANES; j++) {
        found[j] = table[g * LANES + j][n];
    }
    return found;
}

static void part(int which, int g, int n, double *sums)
{
    if (which != 1 && which != 2) {
        a[g].gripper = given(gripper, g, n);
        a[g].contact = b[g].force;
        step_sheath(&a[g]);
    }
    if (which != 0 && which != 2) {
        b[g].heart = given(heart, g, n);
        b[g].tip = which == 1 ? given(gripper, g, n) : a[g].position[2];
        step_wall(&b[g]);
    }
    if (which != 0 && which != 1) {
        for (int i = 0; i < 3; i++) {
            c[g].travel[i] = which == 2 ? given(gripper, g, n) : a[g].position[i];
        }
        c[g].displacement[1] = b[g].displacement;
        step_tip(&c[g]);
    }
    for (int j = 0; j < LANES; j++) {
        sums[g * LANES + j] += b[g].force[j] + a[g].position[2][j] + c[g].frame[3][0][j] + c[g].frame[3][2][j];
    }
}
#endif

int main(void)
{
    static const char *const names[4] = {"sheath", "wall", "guided_tip", "together"};
    prepare();
    for (int which = 0; which < 4; which++) {
        double best = 0.0, sum = 0.0;
        for (int repeat = 0; repeat < REPEATS; repeat++) {
            double took = 0.0, sums[PATIENTS] = {0.0};
            sum = 0.0;
            for (int g = 0; g < PATIENTS / LANES; g++) {
                begin(g);
                const double t0 = now();
                for (int n = 0; n < STEPS; n++) {
                    part(which, g, n, sums);
                }
                took += now() - t0;
            }
            for (int p = 0; p < PATIENTS; p++) {
                sum += sums[p];
            }
            took /= (double)STEPS * PATIENTS;
            best = repeat && best < took ? best : took;
        }
        printf("%s %.1f %.17g\n", names[which], best, sum);
    }
    return 0;
}
