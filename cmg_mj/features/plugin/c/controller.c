#include "controller.h"

#include "sensors.h"

#include <math.h>
#include <string.h>

static int are_finite(const double *numbers, int n)
{
    int result = 1;
    for (int i = 0; i < n; ++i) result = result && isfinite(numbers[i]);
    return result;
}

int controller_place(const controller_type *controller, int at, controller_places *places)
{
    memset(places, 0, sizeof *places);
    places->decisions = at++;
    places->u = at++;
    places->law = at;
    at += controller->law;
    places->observer = at;
    at += controller->observer;
    if (controller->has_backlash) {
        places->motor = at++;
        places->gimbal = at++;
    }
    return at;
}

int controller_decide(
    const controller_type *controller, const controller_places *places, double *memory, const controller_inputs *inputs,
    decision *result)
{
    const double *y = result->y;
    double *estimate = result->estimate, *law = memory + places->law;
    double held = memory[places->u];
    double x[MOST_ESTIMATES];

    controller->measure(inputs->forces, inputs->encoders, result->y);
    result->y[2] -= inputs->coriolis;
    result->y[3] = inputs->gyro;
    if (memory[places->decisions] == 0.0) {
        controller->observer_init(memory + places->observer, y);
        controller->law_init(law, y);
        held = 0.0 * y[0]; /* a zero with its sign, as the runner has it */
        for (int i = 0; i < controller->estimates; ++i) estimate[i] = held;
        estimate[0] = y[0];
        estimate[2] = y[1];
    } else {
        controller->observer_step(memory + places->observer, y, held, estimate);
    }
    if (memory[places->decisions] < controller->trimmed)
        law[controller->integrator] = controller->trim_gain * estimate[controller->trim_part];
    result->rate = controller->feedback == FEEDBACK_OBSERVER ? estimate[1] : inputs->rate;
    x[0] = controller->angles_are_estimated ? estimate[0] : y[0];
    x[1] = result->rate;
    x[2] = controller->angles_are_estimated ? estimate[2] : y[1];
    for (int i = 3; i < controller->estimates; ++i) x[i] = estimate[i];
    result->x_e = controller->integrator < 0 ? (double)NAN : law[controller->integrator];
    controller->law_step(law, y, x, held, &result->u);
    const int is_command = isfinite(result->u); /* an infinite one is none, and not the limit */
    result->u = clip(result->u, -controller->rate_limit, controller->rate_limit);
    memory[places->u] = result->u;
    memory[places->decisions] += 1.0;
    return are_finite(estimate, controller->estimates) && are_finite(law, controller->law) && is_command &&
           are_finite(memory + places->observer, controller->observer);
}

double controller_gimbal_rate(
    const controller_type *controller, const controller_places *places, double *memory, double u)
{
    if (!controller->has_backlash) return u;
    const double half = controller->half_gap, before = memory[places->gimbal];
    const double motor = memory[places->motor] + u * controller->period;
    const double gimbal = clip(before, motor - half, motor + half);
    memory[places->motor] = motor;
    memory[places->gimbal] = gimbal;
    return (gimbal - before) / controller->period;
}
