#include "state.h"

#include <math.h>
#include <string.h>

int axis_place(const axis_type *axis, int at, axis_places *places)
{
    const int gimbals = axis->gimbals;
    places->forces = at;
    places->encoders = places->forces + FORCES;
    places->servos = places->encoders + gimbals;
    places->motors = places->servos + gimbals;
    places->settings = places->motors + gimbals;
    places->held = places->settings + 3;
    places->rate = places->held + 1;
    places->inputs = places->rate + 1;
    places->shown = places->inputs + FORCES + gimbals;
    at = places->shown + SHOWN_ESTIMATE + axis->controller->estimates;
    at = pair_place(&axis->pair, at, &places->pair);
    at = encoder_place(&axis->encoder, at, &places->encoder);
    return controller_place(axis->controller, at, &places->controller);
}

int state_size(const rig_type *type)
{
    axis_places places;
    int at = HEAD;
    for (int i = 0; i < type->axes; ++i) at = axis_place(type->axis[i], at, &places);
    return at;
}

static int axis_decide(const axis_type *axis, const axis_places *places, double *state, double instant)
{
    double forces[FORCES], angles[MOST_GIMBALS], *shown = state + places->shown;
    decision result;
    delivery_read(&axis->pair.delivery, &places->pair.delivery, state, instant, forces);
    delivery_read(&axis->encoder.delivery, &places->encoder, state, instant, angles);
    const int is_good = controller_decide(axis->controller, &places->controller, state, forces, angles, &result);
    memcpy(shown, result.y, sizeof result.y);
    shown[SHOWN_U] = result.u;
    shown[SHOWN_X_E] = result.x_e;
    memcpy(shown + SHOWN_ESTIMATE, result.estimate, (size_t)axis->controller->estimates * sizeof *shown);
    state[places->rate] = controller_gimbal_rate(axis->controller, &places->controller, state, result.u);
    return is_good;
}

int state_advance(const rig_type *type, double *state)
{
    const double instant = state[STEPS] / state[PER_INSTANT];
    const int is_decision = fmod(instant, type->period) == 0.0;
    int at = HEAD, is_good = 1;
    for (int i = 0; i < type->axes; ++i) {
        const axis_type *axis = type->axis[i];
        axis_places places;
        at = axis_place(axis, at, &places);
        const double *inputs = state + places.inputs, *numbers = state + places.settings;
        const sensor_settings settings = {numbers[0], numbers[1], numbers[2]};
        pair_sample(&axis->pair, &places.pair, state, &settings, state[SEED], state[WORLD], instant, inputs);
        encoder_sample(&axis->encoder, &places.encoder, state, &settings, instant, inputs + FORCES);
        if (is_decision) is_good = axis_decide(axis, &places, state, instant) && is_good;
    }
    return is_good;
}
