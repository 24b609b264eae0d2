#include "state.h"

#include "noise.h"

#include <math.h>
#include <string.h>

int reads_gyro(const axis_type *axis)
{
    return axis->controller->feedback == FEEDBACK_FOG || axis->controller->reads_gyro;
}

int axis_place(const axis_type *axis, int at, axis_places *places)
{
    const int gimbals = axis->gimbals;
    places->forces = at;
    places->encoders = places->forces + FORCES;
    places->servos = places->encoders + gimbals;
    places->motors = places->servos + gimbals;
    places->shows = places->motors + gimbals;
    places->settings = places->shows + QUANTITIES;
    places->held = places->settings + 3;
    places->rate = places->held + 1;
    places->inputs = places->rate + 1;
    at = places->inputs + FORCES + gimbals;
    if (reads_gyro(axis)) {
        places->gyro_from = at++;
        places->gyro = at++;
    }
    if (axis->controller->feedback == FEEDBACK_FOG) at = fog_place(&axis->fog, at, &places->fog);
    if (axis->controller->reads_gyro) at = mems_gyro_place(at, &places->mems_gyro);
    if (axis->controller->feedback == FEEDBACK_TRUTH) {
        places->rates_from = at;
        places->rates = at + axis->dofs;
        at = places->rates + axis->dofs;
    }
    places->coriolis = at++;
    places->shown = at;
    at += SHOWN_ESTIMATE + axis->controller->estimates;
    at = pair_place(&axis->pair, at, &places->pair);
    at = encoder_place(&axis->encoder, at, &places->encoder);
    return controller_place(axis->controller, at, &places->controller);
}

int turning_place(const turning_type *turning, int at, turning_places *places)
{
    if (!turning) return at;
    places->rate_from = at++;
    places->rate = at++;
    return mems_gyro_place(at, &places->gyro);
}

int element(double number, int n)
{
    return number >= 0.0 && number < n ? (int)number : -1;
}

int state_size(const rig_type *type)
{
    axis_places places;
    turning_places turning;
    int at = HEAD;
    for (int i = 0; i < type->axes; ++i) at = axis_place(type->axis[i], at, &places);
    return turning_place(type->turning, at, &turning);
}

static double sum_of(const double *numbers, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += numbers[i];
    return sum;
}

double state_constants(const rig_type *type, const double *state)
{
    axis_places places;
    turning_places turning;
    int at = HEAD;
    double sum = state[PER_INSTANT] + state[TIMESTEP] + state[STARTS_SPINNING];
    for (int i = 0; i < type->axes; ++i) {
        const axis_type *axis = type->axis[i];
        at = axis_place(axis, at, &places);
        sum += sum_of(state + places.forces, places.held - places.forces);
        if (reads_gyro(axis)) sum += state[places.gyro_from];
        if (axis->controller->feedback == FEEDBACK_TRUTH) sum += sum_of(state + places.rates_from, axis->dofs);
    }
    if (type->turning) {
        (void)turning_place(type->turning, at, &turning);
        sum += state[turning.rate_from];
    }
    return sum;
}

static int is_whole(double number)
{
    return number >= 0.0 && number <= NOISE_LARGEST && number == floor(number);
}

int is_rate(const axis_type *axis, double rate)
{
    return fabs(rate) <= 1.001 * axis->controller->rate_limit;
}

int state_is_intact(const rig_type *type, const double *state)
{
    axis_places places;
    int at = HEAD, is_intact = state[STATUS] == READY || state[STATUS] == FAILED;
    for (int i = 0; i < type->axes; ++i) {
        at = axis_place(type->axis[i], at, &places);
        is_intact = is_intact && is_rate(type->axis[i], state[places.held]);
    }
    return is_intact && is_whole(state[SEED]) && is_whole(state[WORLD]) && is_whole(state[STEPS]) &&
           state[CHECK] == state_constants(type, state);
}

static int are_finite(const double *numbers, int n)
{
    int result = 1;
    for (int i = 0; i < n; ++i) result &= isfinite(numbers[i]) != 0;
    return result;
}

int state_is_finite(const rig_type *type, const double *state)
{
    axis_places places;
    int at = 0, result = 1, next = HEAD;
    for (int i = 0; i < type->axes; ++i) {
        next = axis_place(type->axis[i], next, &places);
        result &= are_finite(state + at, places.shown - at);
        at = places.shown + SHOWN_ESTIMATE + type->axis[i]->controller->estimates; /* a law may have no integrator */
        result &= are_finite(state + at, next - at);
        at = next;
    }
    return result & are_finite(state + at, state_size(type) - at);
}

/* The tilt rate that is not the observer's, if one is fed back. */
static double other_rate(const axis_type *axis, const axis_places *places, double *state, double instant)
{
    double rate = 0.0;
    if (axis->controller->feedback == FEEDBACK_FOG) {
        delivery_read(&axis->fog.delivery, &places->fog.delivery, state, instant, &rate);
    } else if (axis->controller->feedback == FEEDBACK_TRUTH) {
        for (int i = 0; i < axis->dofs; ++i) {
            const double part = state[places->rates + i] * axis->shares[i];
            rate = i ? rate + part : part;
        }
    }
    return rate;
}

static int axis_decide(
    const axis_type *axis, const axis_places *places, double *state, double instant, decision *result)
{
    double forces[FORCES], angles[MOST_GIMBALS];
    delivery_read(&axis->pair.delivery, &places->pair.delivery, state, instant, forces);
    delivery_read(&axis->encoder.delivery, &places->encoder, state, instant, angles);
    const double rate = other_rate(axis, places, state, instant);
    double gyro = 0.0;
    if (axis->controller->reads_gyro)
        gyro = mems_gyro_read(
            &axis->mems_gyro, &places->mems_gyro, state, state[SEED], state[WORLD], state[places->gyro]);
    const controller_inputs inputs = {forces, angles, rate, state[places->coriolis], gyro};
    return controller_decide(axis->controller, &places->controller, state, &inputs, result);
}

static void axis_sample(const axis_type *axis, const axis_places *places, double *state, double instant)
{
    const double *inputs = state + places->inputs, *numbers = state + places->settings;
    const sensor_settings settings = {numbers[0], numbers[1], numbers[2]};
    const double seed = state[SEED], world = state[WORLD];
    pair_sample(&axis->pair, &places->pair, state, &settings, seed, world, instant, inputs);
    encoder_sample(&axis->encoder, &places->encoder, state, &settings, instant, inputs + FORCES);
    if (axis->controller->feedback == FEEDBACK_FOG)
        fog_sample(&axis->fog, &places->fog, state, seed, world, instant, state[places->gyro]);
}

static double dot(const double *a, const double *b, int n)
{
    double sum = a[0] * b[0];
    for (int i = 1; i < n; ++i) sum = sum + a[i] * b[i];
    return sum;
}

/* Add to each axis' command what cancels the torque of momenta that are swept round; gives the gimbals' commands. */
static void compensate(
    const rig_type *type, const axis_places *places, double *state, int at, decision *results, double *totals)
{
    const turning_type *turning = type->turning;
    const int n = type->axes;
    double turned[MOST_AXES], rates[MOST_AXES];
    turning_places own;
    (void)turning_place(turning, at, &own);
    const double w = mems_gyro_read(&turning->gyro, &own.gyro, state, state[SEED], state[WORLD], state[own.rate]);
    for (int i = 0; i < n; ++i) {
        turned[i] = sin(results[i].y[1]);
        rates[i] = results[i].rate;
    }
    for (int i = 0; i < n; ++i) {
        const double limit = type->axis[i]->controller->rate_limit, u = results[i].u;
        const double added = w * (dot(turning->flywheels[i], turned, n) + dot(turning->inertia[i], rates, n)) /
                             cos(results[i].y[1]);
        const double wanted = u + added, total = wanted < -limit ? -limit : wanted > limit ? limit : wanted;
        totals[i] = total;
        results[i].u = wanted == total ? u : total - added; /* the law's, as far as it was not limited */
        state[places[i].controller.u] = results[i].u;
        state[places[i].coriolis] = w * dot(turning->coriolis[i], rates, n);
    }
}

static void axis_show(const axis_type *axis, const axis_places *places, double *state, const decision *result)
{
    double *shown = state + places->shown;
    memcpy(shown, result->y, SHOWN_U * sizeof *shown);
    shown[SHOWN_U] = result->u;
    shown[SHOWN_X_E] = result->x_e;
    memcpy(shown + SHOWN_ESTIMATE, result->estimate, (size_t)axis->controller->estimates * sizeof *shown);
}

int state_advance(const rig_type *type, double *state)
{
    const double instant = state[STEPS] / state[PER_INSTANT];
    const int is_decision = is_due(instant, type->period);
    axis_places places[MOST_AXES];
    decision results[MOST_AXES];
    double totals[MOST_AXES];
    int at = HEAD, is_good = 1;
    for (int i = 0; i < type->axes; ++i) {
        at = axis_place(type->axis[i], at, &places[i]);
        axis_sample(type->axis[i], &places[i], state, instant);
    }
    if (!is_decision) return 1;
    for (int i = 0; i < type->axes; ++i) {
        is_good = axis_decide(type->axis[i], &places[i], state, instant, &results[i]) && is_good;
        totals[i] = results[i].u;
    }
    if (type->turning) compensate(type, places, state, at, results, totals);
    for (int i = 0; i < type->axes; ++i) {
        const axis_type *axis = type->axis[i];
        axis_show(axis, &places[i], state, &results[i]);
        state[places[i].rate] = controller_gimbal_rate(axis->controller, &places[i].controller, state, totals[i]);
        is_good = is_good && is_rate(axis, state[places[i].rate]);
    }
    return is_good;
}
