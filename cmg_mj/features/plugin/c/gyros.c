#include "gyros.h"

#include "noise.h"

#include <math.h>

int fog_place(const fog_type *fog, int at, fog_places *places)
{
    places->noise = at;
    at += NOISE_WORDS;
    places->has_sampled = at++;
    places->passed = at++;
    return delivery_place(&fog->delivery, at, &places->delivery);
}

void fog_sample(
    const fog_type *fog, const fog_places *places, double *memory, double seed, double world, double instant, double rate)
{
    double normal, reading, *passed = memory + places->passed;
    if (!is_due(instant, fog->period)) return;
    if (!noise_is_started(memory + places->noise)) noise_start(memory + places->noise, seed, world, fog->stream);
    noise_normals(memory + places->noise, &normal, 1);
    *passed = memory[places->has_sampled] == 0.0 ? rate : *passed + fog->share * (rate - *passed);
    memory[places->has_sampled] = 1.0;
    reading = clip(*passed + fog->bias + fog->sigma * normal, -fog->limit, fog->limit);
    deliver(&fog->delivery, &places->delivery, memory, instant, &reading);
}

int mems_gyro_place(int at, mems_gyro_places *places)
{
    places->noise = at;
    places->offset = at + NOISE_WORDS;
    places->drift = places->offset + 1;
    places->samples = places->drift + 1;
    places->wander = places->samples + 1;
    return places->wander + CORNERS;
}

/* Error of the next sample: white noise, then 1/f noise. */
static double next_error(const mems_gyro_type *gyro, const mems_gyro_places *places, double *memory)
{
    double normals[1 + CORNERS], sum = 0.0, *processes = memory + places->wander;
    noise_normals(memory + places->noise, normals, 1 + CORNERS);
    for (int corner = 0; corner < CORNERS; ++corner) {
        processes[corner] = gyro->spread[corner] * normals[1 + corner] + gyro->decay[corner] * processes[corner];
        sum = corner ? sum + processes[corner] : processes[corner];
    }
    return gyro->sigma * normals[0] + sum;
}

/* Begin, with a mean at rest that is taken off, or with the offset and the drift of a part as bought. */
static void start(
    const mems_gyro_type *gyro, const mems_gyro_places *places, double *memory, double seed, double world)
{
    double normals[1 + CORNERS], mean = 0.0;
    noise_start(memory + places->noise, seed, world, gyro->stream);
    noise_normals(memory + places->noise, normals, 1 + CORNERS);
    for (int i = 0; i < CORNERS; ++i) memory[places->wander + i] = gyro->flicker_sigma * normals[1 + i];
    for (int from = 0; from < gyro->resting; from += gyro->piece) {
        double sum = next_error(gyro, places, memory);
        for (int i = 1; i < gyro->piece && from + i < gyro->resting; ++i) sum += next_error(gyro, places, memory);
        mean = mean + sum / gyro->resting;
    }
    memory[places->samples] = memory[places->drift] = 0.0;
    memory[places->offset] = gyro->bias - mean;
    if (gyro->is_as_bought) {
        double part[NOISE_WORDS] = {0}, signs[2];
        noise_start(part, seed, world, gyro->part_stream);
        noise_normals(part, signs, 2);
        memory[places->offset] = gyro->bias + copysign(gyro->offset, signs[0]);
        memory[places->drift] = copysign(gyro->drift, signs[1]);
    }
}

double mems_gyro_read(
    const mems_gyro_type *gyro, const mems_gyro_places *places, double *memory, double seed, double world, double rate)
{
    if (!noise_is_started(memory + places->noise)) start(gyro, places, memory, seed, world);
    const double offset = memory[places->offset] + memory[places->drift] * memory[places->samples];
    const double error = next_error(gyro, places, memory) + offset;
    memory[places->samples] += 1.0;
    const double x = clip(gyro->scale * rate + error, -gyro->limit, gyro->limit);
    return gyro->step != 0.0 ? rint(x / gyro->step) * gyro->step : x;
}
