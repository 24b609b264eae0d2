#include "sensors.h"

#include "noise.h"

#include <math.h>
#include <string.h>

static const int CROSSWISE[FORCES] = {1, 0, 3, 2}; /* each channel's other axis of the same part */

double clip(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}

static double digitised(double x, double limit, double step)
{
    if (!(-limit < x && x < limit)) x = copysign(limit, x);
    return step != 0.0 ? (rint(x / step) + 0.0) * step : x; /* the sum makes -0 to 0, as an integer is */
}

int is_due(double instant, int period)
{
    return fmod(instant, period) == 0.0;
}

/* The integer in a place of the state, whatever a program has written there. */
static int integer(double number, int largest)
{
    return number >= 0.0 && number <= largest ? (int)number : 0;
}

/* Delivery: `newest`, and with latency a queue of (instant of delivery, sample). */

int delivery_place(const delivery_type *delivery, int at, delivery_places *places)
{
    memset(places, 0, sizeof *places);
    places->newest = at;
    at += delivery->width;
    if (delivery->capacity) {
        places->delivered = at;
        places->has_delivered = at + delivery->width;
        places->count = places->has_delivered + 1;
        places->queue = places->count + 1;
        at = places->queue + delivery->capacity * (1 + delivery->width);
    }
    return at;
}

void deliver(
    const delivery_type *delivery, const delivery_places *places, double *memory, double instant, const double *reading)
{
    const size_t width = (size_t)delivery->width;
    memcpy(memory + places->newest, reading, width * sizeof *reading);
    if (delivery->capacity) {
        int count = integer(memory[places->count], delivery->capacity);
        double *queue = memory + places->queue;
        if (count == delivery->capacity) { /* cannot be: the capacity is what can be on the way */
            --count;
            memmove(queue, queue + 1 + width, (size_t)count * (1 + width) * sizeof *queue);
        }
        double *last = queue + (size_t)count * (1 + width);
        last[0] = instant + delivery->latency;
        memcpy(last + 1, reading, width * sizeof *reading);
        memory[places->count] = count + 1;
    }
}

void delivery_read(
    const delivery_type *delivery, const delivery_places *places, double *memory, double instant, double *reading)
{
    const size_t width = (size_t)delivery->width, entry = 1 + width;
    if (!delivery->capacity) {
        memcpy(reading, memory + places->newest, width * sizeof *reading);
        return;
    }
    const int count = integer(memory[places->count], delivery->capacity);
    double *queue = memory + places->queue;
    int taken = 0;
    while (taken < count && (queue[(size_t)taken * entry] <= instant || memory[places->has_delivered] == 0.0)) {
        memcpy(memory + places->delivered, queue + (size_t)taken * entry + 1, width * sizeof *queue);
        memory[places->has_delivered] = 1.0;
        ++taken;
    }
    memmove(queue, queue + (size_t)taken * entry, (size_t)(count - taken) * entry * sizeof *queue);
    memory[places->count] = count - taken;
    memcpy(reading, memory + places->delivered, width * sizeof *reading);
}

/* Accelerometers. */

int pair_place(const pair_type *pair, int at, pair_places *places)
{
    memset(places, 0, sizeof *places);
    places->noise = at;
    at += NOISE_WORDS;
    places->has_sampled = at++;
    if (pair->has_flicker) {
        places->flicker_noise = at;
        at += NOISE_WORDS;
        places->wander = at;
        at += CORNERS * FORCES;
    }
    if (pair->is_filtered) {
        places->filter = at;
        at += 2 * FORCES;
    }
    if (pair->skew) {
        places->outer_count = at++;
        places->outer = at;
        at += 3 * pair->outer_capacity;
    }
    return delivery_place(&pair->delivery, at, &places->delivery);
}

static void distort(const pair_type *pair, const double forces[FORCES], double result[FORCES])
{
    for (int i = 0; i < FORCES; ++i) {
        if (!pair->is_distorted) result[i] = i % 2 ? forces[i] : forces[i] + pair->offset[i];
        else result[i] = pair->by_same[i] * forces[i] + pair->by_other[i] * forces[CROSSWISE[i]] + pair->offset[i];
    }
}

/* Add the 1/f noise of the next sample: a Gauss-Markov process a corner. */
static void wander(const pair_type *pair, const pair_places *places, double *memory, double forces[FORCES])
{
    double normals[CORNERS * FORCES], *processes = memory + places->wander;
    noise_normals(memory + places->flicker_noise, normals, CORNERS * FORCES);
    for (int i = 0; i < FORCES; ++i) {
        double sum = 0.0;
        for (int corner = 0; corner < CORNERS; ++corner) {
            const int k = corner * FORCES + i;
            processes[k] = pair->spread[corner] * normals[k] + pair->decay[corner] * processes[k];
            sum = corner ? sum + processes[k] : processes[k];
        }
        forces[i] = forces[i] + sum;
    }
}

/* Butterworth of second order, which starts settled. */
static double filtered(const pair_type *pair, double state[2], double x, int is_first)
{
    if (is_first) {
        state[0] = (1.0 - pair->b[0]) * x;
        state[1] = (pair->b[2] - pair->a[2]) * x;
    }
    const double y = pair->b[0] * x + state[0];
    state[0] = pair->b[1] * x - pair->a[1] * y + state[1];
    state[1] = pair->b[2] * x - pair->a[2] * y;
    return y;
}

/* One sample inside the parts. */
static void measure(
    const pair_type *pair, const pair_places *places, double *memory, const sensor_settings *settings,
    const double forces[FORCES], double reading[FORCES])
{
    double normals[FORCES];
    const int is_first = memory[places->has_sampled] == 0.0;
    noise_normals(memory + places->noise, normals, FORCES);
    distort(pair, forces, reading);
    for (int i = 0; i < FORCES; ++i) reading[i] = reading[i] + settings->force_sigma * normals[i];
    if (pair->has_flicker) wander(pair, places, memory, reading);
    for (int i = 0; i < FORCES; ++i) {
        if (pair->is_filtered) {
            const double x = clip(reading[i], -pair->limit, pair->limit);
            reading[i] = filtered(pair, memory + places->filter + 2 * i, x, is_first);
        }
        reading[i] = digitised(reading[i], pair->limit, settings->force_step);
    }
    memory[places->has_sampled] = 1.0;
}

/* Remember the outer accelerometer's forces for the inner's later sample, and put the ones of that time in place. */
static void age_outer(
    const pair_type *pair, const pair_places *places, double *memory, double instant, int is_first, double forces[FORCES])
{
    double *entries = memory + places->outer;
    int count = integer(memory[places->outer_count], pair->outer_capacity);
    if (is_first || is_due(instant + pair->skew, pair->raw)) {
        if (count == pair->outer_capacity) --count; /* cannot be */
        entries[3 * count] = instant;
        entries[3 * count + 1] = forces[2];
        entries[3 * count + 2] = forces[3];
        ++count;
    }
    while (count > 1 && entries[3] <= instant - pair->skew) {
        --count;
        memmove(entries, entries + 3, (size_t)count * 3 * sizeof *entries);
    }
    memory[places->outer_count] = count;
    forces[2] = entries[1];
    forces[3] = entries[2];
}

void pair_sample(
    const pair_type *pair, const pair_places *places, double *memory, const sensor_settings *settings, double seed,
    double world, double instant, const double ideal[FORCES])
{
    double forces[FORCES], reading[FORCES];
    const int is_first = memory[places->has_sampled] == 0.0;
    if (!is_first && !is_due(instant, pair->spacing)) return;
    memcpy(forces, ideal, sizeof forces);
    if (pair->skew) age_outer(pair, places, memory, instant, is_first, forces);
    if (!is_first && !is_due(instant, pair->raw)) return;
    if (!noise_is_started(memory + places->noise)) {
        noise_start(memory + places->noise, seed, world, pair->noise_stream);
        if (pair->has_flicker) {
            double *processes = memory + places->wander;
            noise_start(memory + places->flicker_noise, seed, world, pair->flicker_stream);
            noise_normals(memory + places->flicker_noise, processes, CORNERS * FORCES);
            for (int k = 0; k < CORNERS * FORCES; ++k) processes[k] = pair->flicker_sigma * processes[k];
        }
    }
    measure(pair, places, memory, settings, forces, reading);
    if (is_first) /* before the start the rig stood still */
        for (int i = 0; i < pair->settling; ++i) measure(pair, places, memory, settings, forces, reading);
    if (is_first || is_due(instant, pair->period)) deliver(&pair->delivery, &places->delivery, memory, instant, reading);
}

/* Encoders. */

int encoder_place(const encoder_type *encoder, int at, delivery_places *places)
{
    return delivery_place(&encoder->delivery, at, places);
}

void encoder_sample(
    const encoder_type *encoder, const delivery_places *places, double *memory, const sensor_settings *settings,
    double instant, const double *angles)
{
    double reading[MOST_GIMBALS];
    if (!is_due(instant, encoder->period)) return;
    for (int i = 0; i < encoder->delivery.width; ++i)
        reading[i] = settings->angle_step != 0.0 ? digitised(angles[i], INFINITY, settings->angle_step) : angles[i];
    deliver(&encoder->delivery, places, memory, instant, reading);
}
