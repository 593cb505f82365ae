/* One LM629 axis with its motor, moving: what a sample has to compute, written in C.
 *
 * The same rules as vbus/chips/lm628 and vbus/plant, for a host that has loaded a trajectory in
 * velocity mode and touches nothing: profile, error, filter, PWM, armature and shaft, encoder. The
 * motor is solved exactly with its events found by halving, as in vbus/plant/travel.py. The
 * yardstick of benchmarks/core.py.
 *
 *     step [SAMPLES] [moving | hunting]
 *
 * "hunting" is the motor alone, turned round by its command in every period: an event in each.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct {
    int64_t position, velocity, goal, accel;                       /* profile, 1/65536 counts */
    int64_t count, real, real_change, flags, threshold;
    int64_t kp, ki, kd, il, ds, sum, term, derivative, last_error, phase;
    int64_t breakpoint, side;
    int armed, done, motor_off, stop_on_error, sip, wrapped;
    int64_t frame, high_clk, sign;
    double command;
    double supply, amplifier, torque_constant, current;
    double load, static_torque, velocity_rad, first, last;
    int64_t base, plant_count, low, high;
    int stopped, resting;
    double coulomb, resistance, inductance, back_emf, inertia, viscous;
} axis_t;

/* Changes of current, speed and place in a span, of current, speed, volts and torque. */
typedef struct { double i[4], w[4], p[4], blocked, seconds; } span_t;

#define LEVELS 34
#define TICKS ((int64_t)1 << LEVELS)
#define NOWHERE 1e300

static span_t spans[LEVELS + 1];

static int64_t sat16(int64_t v) { return v > 32767 ? 32767 : v < -32768 ? -32768 : v; }

static int64_t wrap31(int64_t v) { return ((v + (1 << 30)) & 0x7fffffff) - (1 << 30); }

static void profile(axis_t *a)
{
    int64_t v = a->velocity;
    if (v < a->goal) {
        v += a->accel;
        if (v > a->goal) v = a->goal;
    } else {
        v -= a->accel;
        if (v < a->goal) v = a->goal;
    }
    a->velocity = v;
    int64_t p = a->position + v;
    if (p < -((int64_t)1 << 46) || p >= (int64_t)1 << 46) {
        p = ((p + ((int64_t)1 << 46)) & (((int64_t)1 << 47) - 1)) - ((int64_t)1 << 46);
        a->wrapped = 1;
    }
    a->position = p;
}

static int64_t filter(axis_t *a, int64_t error)
{
    if (a->phase == 0) {
        a->derivative = sat16(a->kd * (error - a->last_error));
        a->last_error = error;
    }
    if (++a->phase > a->ds) a->phase = 0;
    int64_t total = a->sum + error;
    if (total > 0x7fffff) total = 0x7fffff;
    if (total < -0x7fffff) total = -0x7fffff;
    int64_t term = sat16(a->ki * (total >> 8));
    if (term > a->il || term < -a->il) {
        term = term > 0 ? a->il : -a->il;
        if (llabs(total) <= llabs(a->sum)) a->sum = total;
    } else {
        a->sum = total;
    }
    a->term = term;
    return sat16(sat16(a->kp * error) + term + a->derivative);
}

static span_t twice(const span_t *s)
{
    span_t two;
    for (int of = 0; of < 4; of++) {
        two.i[of] = 2 * s->i[of] + (s->i[0] * s->i[of] + s->i[1] * s->w[of]);
        two.w[of] = 2 * s->w[of] + (s->w[0] * s->i[of] + s->w[1] * s->w[of]);
        two.p[of] = 2 * s->p[of] + (s->p[0] * s->i[of] + s->p[1] * s->w[of]);
    }
    two.blocked = 2 * s->blocked + s->blocked * s->blocked;
    two.seconds = 2 * s->seconds;
    return two;
}

/* A tick is so short that the first two orders are exact. */
static void respond(const axis_t *a, double period, double counts)
{
    double h = period / TICKS, r = a->resistance, l = a->inductance, j = a->inertia;
    double ii = -r / l * h, iw = -a->back_emf / l * h;
    double wi = a->torque_constant / j * h, ww = -a->viscous / j * h;
    span_t s = {
        .i = {ii, iw, h / l * (1 + ii / 2), h / j * iw / 2},
        .w = {wi, ww, h / l * wi / 2, h / j * (1 + ww / 2)},
        .p = {counts * h * wi / 2, counts * h, counts * h * h / l * wi / 6, counts * h * h / j / 2},
        .blocked = ii, .seconds = h,
    };
    spans[LEVELS] = s;
    for (int level = LEVELS; level > 0; level--) spans[level - 1] = twice(&spans[level]);
}

static double change(const double *of, double i, double w, double v, double q)
{
    return (of[0] * i + of[1] * w) + (of[2] * v + of[3] * q);
}

/* Whether a speed that falls and rises again within a span stays above zero. */
static int clear(const axis_t *a, double way, double i, double w, double v, double q, double h)
{
    double damping = a->viscous + a->torque_constant * a->back_emf / a->resistance;
    double goal = (a->torque_constant / a->resistance * v + q) / damping;
    if (way * goal > 0) {
        double off = w - goal, astray = i - (v - a->back_emf * goal) / a->resistance;
        double swing = a->inductance * a->torque_constant / (a->inertia * a->back_emf);
        if (goal * goal > off * off + swing * astray * astray) return 1;
    }
    double pull = a->torque_constant * i - a->viscous * w + q;
    if (way * (a->inertia * w + pull * h) <= 0) return 0;
    double driving = v - a->resistance * i - a->back_emf * w;
    return way * (a->torque_constant * driving - a->viscous * a->inductance * pull / a->inertia) >= 0;
}

static double go(axis_t *a, double v, double place)
{
    double i = a->current, w = a->velocity_rad, low = -NOWHERE, high = NOWHERE;
    double settled = v / a->resistance, turning = w > 0 ? 1 : w < 0 ? -1 : 0, most = 0, least = 0;
    int standing = turning == 0, decided = !standing, held = 0, sure = 0, events = 0, level = 0;
    int64_t tick = 0, size = TICKS;
    if (a->stopped) {
        low = (double)(a->low - a->base) + 0.5;
        high = (double)(a->high - a->base) + 0.5;
    }
    while (tick < TICKS) {
        if (!decided) {
            decided = 1;
            most = place >= high || held ? NOWHERE : a->static_torque;
            least = place <= low || held ? -NOWHERE : -a->static_torque;
            double torque = a->torque_constant * i - a->load;
            standing = least <= torque && torque <= most;
            turning = torque > 0 ? 1 : -1;
        }
        while (size > TICKS - tick) { size >>= 1; level++; }
        const span_t *s = &spans[level];
        if (standing) {
            double after = i + (i - settled) * s->blocked;
            double torque = a->torque_constant * after - a->load;
            if (torque < least || torque > most) {
                if (level < LEVELS) { sure = 1; size >>= 1; level++; continue; }
                sure = decided = 0;
                events++;
            }
            i = after;
        } else {
            double q = -a->load - turning * a->coulomb;
            double after = i + change(s->i, i, w, v, q), faster = w + change(s->w, i, w, v, q);
            double there = place + change(s->p, i, w, v, q);
            int stops = turning * faster <= 0, hits = turning > 0 ? there >= high : there <= low;
            if (stops || hits) {
                if (level < LEVELS) { sure = 1; size >>= 1; level++; continue; }
                sure = decided = 0;
                if (hits) there = turning > 0 ? high : low;
                faster = 0;
                events++;
            } else if (level < LEVELS
                       && turning * (a->torque_constant * i - a->viscous * w + q) < 0
                       && turning * (a->torque_constant * after - a->viscous * faster + q) > 0
                       && !clear(a, turning, i, w, v, q, s->seconds)) {
                sure = 0;
                size >>= 1;
                level++;
                continue;
            }
            i = after; w = faster; place = there;
        }
        tick += size;
        held = events >= 64;
        if (sure) {
            if (level < LEVELS) { size >>= 1; level++; continue; }
            sure = 0;
        }
        while (level > 0 && !(tick & size)) { size <<= 1; level--; }
    }
    if (w == 0 && i > -1e-12 && i < 1e-12) i = 0;
    a->current = i;
    a->velocity_rad = w;
    return place;
}

static double leap(axis_t *a, double v, double place)
{
    const span_t *s = spans;
    double i = a->current, w = a->velocity_rad;
    if (w == 0) return go(a, v, place);
    double way = w > 0 ? 1 : -1, q = -a->load - way * a->coulomb;
    double pull = a->torque_constant * i - a->viscous * w + q;
    double after = i + change(s->i, i, w, v, q), faster = w + change(s->w, i, w, v, q);
    double here = place + change(s->p, i, w, v, q);
    if (way * faster <= 0) return go(a, v, place);
    if (way * pull < 0 && way * (a->torque_constant * after - a->viscous * faster + q) > 0
        && !clear(a, way, i, w, v, q, s->seconds)) return go(a, v, place);
    if (a->stopped && (here >= (double)(a->high - a->base) + 0.5
                       || here <= (double)(a->low - a->base) + 0.5)) return go(a, v, place);
    a->current = after;
    a->velocity_rad = faster;
    return here;
}

static void motor(axis_t *a)
{
    double volts = a->command * a->amplifier;
    if (volts > a->supply) volts = a->supply;
    if (volts < -a->supply) volts = -a->supply;
    double before = a->current, departed = a->velocity_rad;
    double here = a->last - (double)(a->plant_count - a->base);
    if (here >= 1.0) here = 0.99999999999999988898;
    a->base = a->plant_count;
    a->first = here;
    here = leap(a, volts, here);
    a->resting = a->current == before && a->velocity_rad == departed && here == a->first;
    a->last = here;
    int64_t whole = (int64_t)here;
    a->plant_count = a->base + (here < (double)whole ? whole - 1 : whole);
}

void sample(axis_t *a)
{
    int64_t change = a->plant_count - a->count;
    a->count = a->plant_count;
    a->real_change = change;
    int64_t real = a->real + change;
    if (real < -(1 << 30) || real > (1 << 30) - 1) {
        real = wrap31(real);
        a->flags |= 8;
    }
    a->real = real;
    if (!a->done) profile(a);
    int64_t error = (a->position >> 16) - real, command = 0;
    if (error < -(1 << 30) || error > (1 << 30) - 1) error = wrap31(error);
    error = sat16(error);
    if (llabs(error) > a->threshold) {
        a->flags |= 32;
        if (a->stop_on_error) a->motor_off = 1;
    }
    if (!a->motor_off) command = filter(a, error);
    if (a->armed) {
        int64_t ahead = (a->breakpoint > real) - (a->breakpoint < real);
        if (ahead == 0 || ahead != a->side) {
            a->flags |= 64;
            a->armed = 0;
        }
    }
    if (a->wrapped) {
        a->wrapped = 0;
        a->flags |= 8;
    }
    int64_t value = command >> 8, magnitude = value < 0 ? -value : value;
    if (magnitude > 127) magnitude = 127;
    a->sign = value < 0 ? 2 : 0;
    a->high_clk = magnitude * a->frame / 128;
    a->command = (double)(value < 0 ? -magnitude : magnitude) / 128.0;
    motor(a);
}

int main(int argc, char **argv)
{
    long samples = argc > 1 ? atol(argv[1]) : 50000;
    int hunting = argc > 2 && strcmp(argv[2], "hunting") == 0;
    double period = 256e-6, inertia = 5e-6, viscous = 1e-6, coulomb = 0.002, resistance = 2.5;
    double inductance = 0.0005, torque_constant = 0.03, back_emf = 0.03;
    axis_t a = {
        .goal = 1 << 16, .accel = 1000, .threshold = 32767, .kp = 300, .kd = 2000,
        .frame = 512, .supply = 24.0, .amplifier = 24.0, .torque_constant = torque_constant,
        .static_torque = 0.0025, .first = 0.5, .last = 0.5,
        .coulomb = coulomb, .resistance = resistance, .inductance = inductance,
        .back_emf = back_emf, .inertia = inertia, .viscous = viscous,
    };
    respond(&a, period, 2000 / 6.283185307179586);
    double best = 1e9;
    for (int round = 0; round < 20; round++) {
        struct timespec start, end;
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &start);
        for (long n = 0; n < samples; n++) {
            if (hunting) {
                a.command = n & 1 ? -0.5 : 0.5;
                motor(&a);
            } else {
                sample(&a);
            }
        }
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
        double ns = (end.tv_sec - start.tv_sec) * 1e9 + (end.tv_nsec - start.tv_nsec);
        if (ns < best) best = ns;
    }
    printf("%.3f %lld\n", best / samples, (long long)a.plant_count);
    return 0;
}
