/* The callbacks of MuJoCo's engine plugin.
 *
 * A decision is taken in the sensors' pass, before the actuators' of the same step, and counts once `advance` is
 * called: a program may call mj_forward as often as it likes. Whatever d->ctrl says of the pair's drives is ignored. */
#include "setup.h"

#include <math.h>
#include <string.h>

static double *state_of(const mjModel *m, mjData *d, int instance)
{
    return d->plugin_state + m->plugin_stateadr[instance];
}

static int nstate(const mjModel *m, int instance)
{
    (void)m, (void)instance;
    return 2 * rig.size;
}

static int nsensordata(const mjModel *m, int instance, int sensor)
{
    return shown_size(m, instance, sensor);
}

static int init(const mjModel *m, mjData *d, int instance)
{
    char message[MESSAGE] = "";
    d->plugin_data[instance] = 0;
    if (setup(m, instance, state_of(m, d, instance), message)) return 0;
    mju_warning("%s: %s", rig.plugin, message);
    return -1;
}

static void reset(const mjModel *m, mjtNum *state, void *data, int instance)
{
    char message[MESSAGE] = "";
    (void)data;
    if (setup(m, instance, state, message)) return;
    mju_warning("%s: %s; nothing is controlled", rig.plugin, message);
    state[STATUS] = UNREADY;
}

/* u = 0 from now on, until a reset. */
static void fail(double *state, const char *why)
{
    mju_warning("%s: %s; u = 0 from now on", rig.plugin, why);
    state[STATUS] = FAILED;
    state[IS_PENDING] = 0;
    for (int i = 0; i < rig.axes; ++i)
        state[rig.held + i] = state[rig.rate + i] = state[rig.axis[i].shown + SHOWN_U] = 0;
}

/* A program has written into the state what cannot be there: begin anew, at rest. */
static void restore(const mjModel *m, double *state, int instance)
{
    reset(m, state, NULL, instance);
    if (state[STATUS] == READY) fail(state, "a program has overwritten its state");
}

static double limited(const mjModel *m, int actuator, double control)
{
    const int i = m->actuator_ctrladr[actuator];
    const double *range = m->actuator_ctrlrange + 2 * i;
    if (!m->actuator_ctrllimited[i] || (m->opt.disableflags & mjDSBL_CLAMPCTRL)) return control;
    return control < range[0] ? range[0] : control > range[1] ? range[1] : control;
}

/* The gimbals' servos: the rate at which their setpoints move. */
static void actuator_act_dot(const mjModel *m, mjData *d, int instance)
{
    const double *state = state_of(m, d, instance);
    if (state[STATUS] == UNREADY) return;
    for (int i = 0; i < rig.axes; ++i) {
        const axis_type *axis = &rig.axis[i];
        const double rate = is_rate(i, state[rig.rate + i]) ? state[rig.rate + i] : 0.0;
        for (int j = 0; j < axis->gimbals; ++j) {
            const int servo = element(state[axis->servos + j], (int)m->nactuator);
            const int act = servo < 0 ? -1 : m->actuator_actadr[servo];
            if (act >= 0) d->act_dot[act] = limited(m, servo, axis->modules[j].direction * rate);
        }
    }
}

/* The flywheels' motors: their force at the nominal speed. */
static void drive_flywheels(const mjModel *m, mjData *d, const double *state)
{
    for (int i = 0; i < rig.axes; ++i) {
        const axis_type *axis = &rig.axis[i];
        for (int j = 0; j < axis->gimbals; ++j) {
            const int motor = element(state[axis->motors + j], (int)m->nactuator);
            if (motor < 0) continue;
            const int out = m->actuator_outadr[motor];
            const double *bias = m->actuator_biasprm + mjNBIAS * motor;
            double force = m->actuator_gainprm[mjNGAIN * motor] * limited(m, motor, axis->modules[j].speed);
            if (m->actuator_biastype[motor] == mjBIAS_AFFINE)
                force += bias[0] + bias[1] * d->actuator_length[out] + bias[2] * d->actuator_velocity[out];
            d->actuator_force[out] = force;
        }
    }
}

/* Show the accelerometers the present state under the command that still holds: MuJoCo computes them later. */
static void sense(const mjModel *m, mjData *d)
{
    mj_markStack(d);
    double *qacc = mj_stackAllocNum(d, (size_t)m->nv);
    memcpy(qacc, d->qacc, (size_t)m->nv * sizeof *qacc); /* mj_inverse has it as an input */
    mj_fwdActuation(m, d);
    mj_fwdAcceleration(m, d);
    mj_fwdConstraint(m, d);
    d->flg_rnepost = 0; /* the accelerations of the step before */
    mj_sensorAcc(m, d);
    memcpy(d->qacc, qacc, (size_t)m->nv * sizeof *qacc);
    d->flg_rnepost = 0; /* all of it comes again */
    mj_freeStack(d);
}

/* Take the numbers at the places that the state names; 0 if one is missing or no number. */
static int read_inputs(const mjModel *m, const mjData *d, double *state)
{
    int is_finite = 1;
    for (int i = 0; i < rig.inputs; ++i) {
        const int is_rate = rig.input[i].is_rate;
        const int place = element(state[rig.from + i], (int)(is_rate ? m->nv : m->nsensordata));
        double *input = state + rig.taken + i;
        *input = place < 0 ? (double)NAN : is_rate ? d->qvel[place] : d->sensordata[place];
        is_finite = is_finite && isfinite(*input);
    }
    return is_finite;
}

/* Decide on the inputs, in the state's second half: all but what is commanded and shown counts once a step is taken. */
static int decide(double *state)
{
    double *decided = state + rig.size;
    memcpy(decided, state, (size_t)rig.size * sizeof *state);
    const int is_good = state_advance(decided);
    memcpy(state + rig.rate, decided + rig.rate, (size_t)rig.axes * sizeof *state);
    memcpy(state + rig.shown, decided + rig.shown, (size_t)(rig.memory - rig.shown) * sizeof *state);
    return is_good;
}

static void take_instant(const mjModel *m, mjData *d, double *state)
{
    state[IS_PENDING] = 0;
    memcpy(state + rig.rate, state + rig.held, (size_t)rig.axes * sizeof *state);
    if (m->opt.timestep != state[TIMESTEP]) {
        fail(state, "the physics step was changed");
        return;
    }
    if (fmod(state[STEPS], state[PER_INSTANT]) != 0.0) return;
    if (!state_is_finite(state)) {
        fail(state, "a number in its state is none");
        return;
    }
    sense(m, d);
    if (!read_inputs(m, d, state)) fail(state, "what the sensors show is no number");
    else if (!decide(state)) fail(state, "the observer or the law gave no finite number");
    else state[IS_PENDING] = 1;
}

/* Whether an instance of this library is to set its flywheels going: at every pass before its first step. */
static int is_to_spin(const mjModel *m, mjData *d, int instance)
{
    const double *state = state_of(m, d, instance);
    return state[STATUS] == READY && state[STARTS_SPINNING] != 0.0 && state[STEPS] == 0.0;
}

/* Set the flywheels of all instances going, and come to this stage again: MuJoCo has computed it with what the program
 * had set. The first instance does so for all, since each repetition calls them all; 0 if it is another one. */
static int start_spinning(const mjModel *m, mjData *d, int instance)
{
    double *state = state_of(m, d, instance);
    const int slot = m->plugin[instance];
    if (state[IS_SPINNING_UP] != 0.0) return 0;
    for (int i = 0; i < instance; ++i)
        if (m->plugin[i] == slot && is_to_spin(m, d, i)) return 0;
    for (int i = instance; i < m->nplugin; ++i)
        if (m->plugin[i] == slot && is_to_spin(m, d, i)) spin(m, d, i);
    state[IS_SPINNING_UP] = 1;
    mj_fwdPosition(m, d);
    mj_sensorPos(m, d);
    mj_fwdVelocity(m, d);
    mj_sensorVel(m, d); /* calls `compute` */
    state[IS_SPINNING_UP] = 0;
    return 1;
}

static void compute(const mjModel *m, mjData *d, int instance, int capability)
{
    double *state = state_of(m, d, instance);
    if (state[STATUS] == UNREADY) return;
    if (capability == mjPLUGIN_ACTUATOR) {
        drive_flywheels(m, d, state);
        return;
    }
    if (!state_is_intact(state)) restore(m, state, instance);
    if (is_to_spin(m, d, instance) && start_spinning(m, d, instance)) return;
    if (state[STATUS] == READY) take_instant(m, d, state);
    show(m, state, d->sensordata);
}

/* Whether MuJoCo leaves an actuator out that the state names. */
static int is_off(const mjModel *m, double number)
{
    const int actuator = element(number, (int)m->nactuator), group = actuator < 0 ? -1 : m->actuator_group[actuator];
    return group >= 0 && group < 31 && (m->opt.disableactuator & (1 << group));
}

static int drives_are_off(const mjModel *m, const double *state)
{
    int result = (m->opt.disableflags & mjDSBL_ACTUATION) != 0;
    for (int i = 0; i < rig.axes; ++i)
        for (int j = 0; j < rig.axis[i].gimbals; ++j)
            result = result || is_off(m, state[rig.axis[i].servos + j]) || is_off(m, state[rig.axis[i].motors + j]);
    return result;
}

/* A step has been taken: the decision counts. */
static void advance(const mjModel *m, mjData *d, int instance)
{
    double *state = state_of(m, d, instance);
    if (state[STATUS] != READY) return;
    if (drives_are_off(m, state)) {
        fail(state, "its drives were switched off during a step");
        return;
    }
    if (state[IS_PENDING] != 0.0) {
        memcpy(state + HEAD, state + rig.size + HEAD, (size_t)(rig.size - HEAD) * sizeof *state);
        memcpy(state + rig.held, state + rig.rate, (size_t)rig.axes * sizeof *state);
        state[IS_PENDING] = 0;
    } else if (fmod(state[STEPS], state[PER_INSTANT]) == 0.0) {
        fail(state, "a step without its sensors (are they switched off?)");
        return;
    }
    state[STEPS] += 1.0;
}

/* Whether another library that has registered this plugin's name is a copy of this one. */
static int is_copy(const mjpPlugin *other)
{
    for (int i = 0; i < other->nattribute; ++i)
        if (!strcmp(other->attributes[i], rig.build)) return 1;
    return 0;
}

mjPLUGIN_LIB_INIT(cmg_mj)
{
    mjpPlugin plugin;
    const mjpPlugin *other;
    const char *attributes[SETUP_KEYS + 1]; /* the last one tells copies */
    if (mj_version() != mjVERSION_HEADER) {
        mju_warning("%s: made for MuJoCo %d, and this is %d: not loaded", rig.plugin, mjVERSION_HEADER, mj_version());
        return;
    }
    other = mjp_getPlugin(rig.plugin, NULL);
    if (other) {
        if (!is_copy(other))
            mju_warning("%s: has been loaded already, from another library, which stays in force", rig.plugin);
        return;
    }
    for (int i = 0; i < SETUP_KEYS; ++i) attributes[i] = setup_keys[i];
    attributes[SETUP_KEYS] = rig.build;
    mjp_defaultPlugin(&plugin);
    plugin.name = rig.plugin;
    plugin.nattribute = SETUP_KEYS + 1;
    plugin.attributes = attributes;
    plugin.capabilityflags = mjPLUGIN_SENSOR | mjPLUGIN_ACTUATOR;
    plugin.needstage = mjSTAGE_VEL;
    plugin.nstate = nstate;
    plugin.nsensordata = nsensordata;
    plugin.init = init;
    plugin.reset = reset;
    plugin.compute = compute;
    plugin.advance = advance;
    plugin.actuator_act_dot = actuator_act_dot;
    (void)mjp_registerPlugin(&plugin);
}
