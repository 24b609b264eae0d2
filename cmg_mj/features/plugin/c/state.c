#include "rig.h"

#include "noise.h"

#include <math.h>
#include <string.h>

int element(double number, int n)
{
    return number >= 0.0 && number < n ? (int)number : -1;
}

double state_constants(const double *s)
{
    double sum = s[PER_INSTANT] + s[TIMESTEP] + s[STARTS_SPINNING];
    for (int i = HEAD; i < rig.held; ++i) sum += s[i];
    return sum;
}

static int is_whole(double number)
{
    return number >= 0.0 && number <= NOISE_LARGEST && number == floor(number);
}

int is_rate(int axis, double rate)
{
    return fabs(rate) <= 1.001 * rig.axis[axis].rate_limit;
}

int state_is_intact(const double *s)
{
    int is_intact = s[STATUS] == READY || s[STATUS] == FAILED;
    for (int i = 0; i < rig.axes; ++i) is_intact = is_intact && is_rate(i, s[rig.held + i]);
    return is_intact && is_whole(s[SEED]) && is_whole(s[WORLD]) && is_whole(s[STEPS]) && s[CHECK] == state_constants(s);
}

static int are_finite(const double *s, int from, int end)
{
    int result = 1;
    for (int i = from; i < end; ++i) result &= isfinite(s[i]) != 0;
    return result;
}

int state_is_finite(const double *s)
{
    return are_finite(s, 0, rig.shown) && are_finite(s, rig.memory, rig.size); /* a law may have no integrator */
}

static int is_due(double instant, int period)
{
    return fmod(instant, period) == 0.0;
}

/* Put a row of numbers before others, of which the last one goes. */
static void shift(double *rows, int n, int width, const double *row)
{
    const size_t size = (size_t)width * sizeof *rows;
    memmove(rows + width, rows, (size_t)(n - 1) * size);
    memcpy(rows, row, size);
}

/* Take what is due, as `Sensor.init` and `Sensor.sample` of cmg_mj/core/sensor.py do. */
static void sample(const sensor_type *sensor, double *s, double instant)
{
    double x[sensor->channels], y[sensor->width];
    const int is_first = instant == 0.0, is_taken = is_due(instant, sensor->raw);
    const int is_older = sensor->skew && !is_first && is_due(instant + sensor->skew, sensor->raw);
    const int half = sensor->channels / 2, last = (sensor->older_kept - 1) * sensor->channels;
    if (!is_taken && !is_older) return;
    sensor->ideal(s, x, x);
    for (int i = 0; i < (is_first ? sensor->older_kept : is_older); ++i)
        shift(s + sensor->older, sensor->older_kept, sensor->channels, x);
    if (!is_taken) return;
    if (sensor->skew) memcpy(x + half, s + sensor->older + last + half, (size_t)(sensor->channels - half) * sizeof *x);
    (is_first ? sensor->init : sensor->take)(s, x, y);
    for (int i = 0; is_first && i < sensor->settling; ++i) sensor->take(s, x, y);
    for (int i = 0; i < (is_first ? sensor->kept : is_due(instant, sensor->period)); ++i)
        shift(s + sensor->readings, sensor->kept, sensor->width, y);
}

static void deliver(const sensor_type *sensor, double *s, double instant)
{
    const double late = floor((instant - sensor->latency) / sensor->period);
    const int reading = element(floor(instant / sensor->period) - late, sensor->kept);
    const double *from = s + sensor->readings + (reading < 0 ? 0 : reading) * sensor->width;
    if (sensor->latency) memcpy(s + sensor->delivered, from, (size_t)sensor->width * sizeof *s);
}

int state_advance(double *s)
{
    const double instant = s[STEPS] / s[PER_INSTANT];
    int is_good = 1;
    for (int i = 0; instant == 0.0 && i < rig.streams; ++i)
        noise_start(s + rig.noise + NOISE_WORDS * i, s[SEED], s[WORLD], rig.stream[i]);
    for (int i = 0; i < rig.sensors; ++i) sample(&rig.sensor[i], s, instant);
    if (!is_due(instant, rig.period)) return 1;
    for (int i = 0; i < rig.sensors; ++i) deliver(&rig.sensor[i], s, instant);
    (instant == 0.0 ? rig.first : instant < rig.settled ? rig.trimmed : rig.later)(s, s, s);
    for (int i = 0; i < rig.axes; ++i) {
        const axis_type *axis = &rig.axis[i];
        const int estimate = axis->shown + SHOWN_ESTIMATE;
        is_good = is_good && is_rate(i, s[rig.rate + i]) && are_finite(s, axis->shown, axis->shown + SHOWN_X_E) &&
                  are_finite(s, estimate, estimate + axis->estimates);
    }
    return is_good && are_finite(s, rig.memory, rig.noise);
}
