#include "setup.h"

#include "noise.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST_NAME = 300 };
static const char INSTANCE[] = "balance"; /* what stands before it in an instance's name is the rig's prefix */
static const double STANDARD_GRAVITY = 9.80665;
static const double TURN = 2.0 * 3.141592653589793;

enum { KEY_SEED, KEY_WORLD, KEY_NOISE, KEY_FORCE_COUNTS, KEY_ANGLE_COUNTS, KEY_START, KEY_BUILD };
const char *const setup_keys[SETUP_KEYS] = {
    "seed", "world", "noise_density_ug_rthz", "counts_per_g", "counts_per_revolution", "start", "build"};

typedef struct {
    const mjModel *m;
    const char *prefix;
    int prefix_length;
    char *message;
} search;

static int refuse(const search *in, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(in->message, MESSAGE, format, arguments);
    va_end(arguments);
    return 0;
}

static const char *instance_name(const mjModel *m, int instance)
{
    return m->names + m->name_pluginadr[instance];
}

static int prefix_length(const char *name)
{
    const size_t length = strlen(name), last = sizeof INSTANCE - 1;
    return length >= last && !strcmp(name + length - last, INSTANCE) ? (int)(length - last) : -1;
}

/* Number of an element by its name behind the prefix, or -1 and a message. */
static int find(const search *in, int type, const char *kind, const char *first, const char *last)
{
    char name[LONGEST_NAME];
    const int length = snprintf(name, sizeof name, "%.*s%s%s", in->prefix_length, in->prefix, first, last);
    const int id = length < LONGEST_NAME ? mj_name2id(in->m, type, name) : -1;
    if (id < 0) (void)refuse(in, "the model has no %s '%s'", kind, name);
    return id;
}

/* Number of a joint of a kind, or -1 and a message. */
static int find_joint(const search *in, const char *first, const char *last, mjtJoint kind)
{
    const int id = find(in, mjOBJ_JOINT, "joint", first, last);
    if (id < 0 || in->m->jnt_type[id] == (int)kind) return id;
    (void)refuse(in, "joint '%s%s' must be %s", first, last, kind == mjJNT_FREE ? "free" : "a hinge");
    return -1;
}

static int find_sensor(const search *in, const char *first, const char *last, int kind, double *place)
{
    const int id = find(in, mjOBJ_SENSOR, "sensor", first, last);
    if (id < 0) return 0;
    if (in->m->sensor_type[id] != kind) return refuse(in, "sensor '%s%s' is of another kind than it must be", first, last);
    if (in->m->sensor_delay[id] != 0.0 || in->m->sensor_historyadr[id] >= 0)
        return refuse(in, "sensor '%s%s' has a delay or a history", first, last);
    *place = in->m->sensor_adr[id];
    return 1;
}

static int find_encoder(const search *in, const char *name, int gimbal)
{
    double place;
    if (!find_sensor(in, name, "/gimbal_encoder", mjSENS_JOINTPOS, &place)) return 0;
    const int id = find(in, mjOBJ_SENSOR, "sensor", name, "/gimbal_encoder");
    if (in->m->sensor_objid[id] == gimbal) return 1;
    return refuse(in, "sensor '%s/gimbal_encoder' must be of joint '%s/gimbal'", name, name);
}

static int find_actuator(
    const search *in, const char *first, const char *last, int dynamics, int joint, double *number)
{
    const mjModel *m = in->m;
    const int id = find(in, mjOBJ_ACTUATOR, "actuator", first, last);
    if (id < 0) return 0;
    if (m->actuator_dyntype[id] != dynamics || m->actuator_gaintype[id] != mjGAIN_FIXED ||
        (m->actuator_biastype[id] != mjBIAS_AFFINE && m->actuator_biastype[id] != mjBIAS_NONE) ||
        m->actuator_outnum[id] != 1 || m->actuator_ctrlnum[id] != 1 ||
        m->actuator_actnum[id] != (dynamics == mjDYN_INTEGRATOR ? 1 : 0))
        return refuse(in, "actuator '%s%s' must be %s", first, last,
            dynamics == mjDYN_INTEGRATOR ? "an <intvelocity>" : "a <velocity>");
    if (m->actuator_actearly[id] || m->actuator_delay[id] != 0.0 || m->actuator_historyadr[id] >= 0)
        return refuse(in, "actuator '%s%s' has actearly, a delay or a history", first, last);
    if (m->actuator_trntype[id] != mjTRN_JOINT || m->actuator_trnid[2 * id] != joint)
        return refuse(in, "actuator '%s%s' must drive joint '%s'", first, last, m->names + m->name_jntadr[joint]);
    const int group = m->actuator_group[id];
    if (group >= 0 && group < 31 && (m->opt.disableactuator & (1 << group)))
        return refuse(in, "actuator '%s%s' is in a group that is switched off", first, last);
    *number = id;
    return 1;
}

static int find_input(const search *in, const input_type *input, double *place)
{
    if (input->is_rate) {
        const int joint = find_joint(in, input->name, "", input->kind);
        if (joint < 0) return 0;
        *place = in->m->jnt_dofadr[joint];
    } else if (!find_sensor(in, input->name, "", input->kind, place)) {
        return 0;
    }
    *place += input->offset;
    return 1;
}

static int find_modules(const search *in, const axis_type *axis, double *state)
{
    for (int i = 0; i < axis->gimbals; ++i) {
        const char *name = axis->modules[i].name;
        double *servo = &state[axis->servos + i], *motor = &state[axis->motors + i];
        const int gimbal = find_joint(in, name, "/gimbal", mjJNT_HINGE);
        const int flywheel = gimbal < 0 ? -1 : find_joint(in, name, "/flywheel", mjJNT_HINGE);
        if (flywheel < 0 || !find_encoder(in, name, gimbal)) return 0;
        if (!find_actuator(in, name, "/gimbal_servo", mjDYN_INTEGRATOR, gimbal, servo)) return 0;
        if (!find_actuator(in, name, "/flywheel_motor", mjDYN_NONE, flywheel, motor)) return 0;
    }
    return 1;
}

/* A number of <config>, or what it is without one. */
static int configured(const search *in, int instance, int key, double otherwise, double most, int is_integer, double *value)
{
    const char *text = mj_getPluginConfig(in->m, instance, setup_keys[key]);
    char *end = NULL;
    *value = otherwise;
    if (!text || !*text) return 1;
    const double number = strtod(text, &end);
    const int is_too_long = is_integer && strtoull(text, NULL, 10) > (unsigned long long)most; /* rounded, it is not */
    const int is_empty = end == text;
    const int is_decimal = !text[strspn(text, is_integer ? "0123456789" : "0123456789.eE+- ")];
    while (*end == ' ') ++end;
    if (!is_decimal || is_too_long || *end || is_empty || !(number >= 0.0 && number <= most) || (is_integer && number != floor(number)))
        return refuse(in, "<config key=\"%s\" value=\"%.40s\">: must be %s from 0 to %.16g", setup_keys[key], text,
            is_integer ? "a whole number" : "a number", most);
    *value = number;
    return 1;
}

static int configure(const search *in, int instance, double *state)
{
    const double unset = -1.0, most = 1e9;
    double density, force_counts, angle_counts;
    const char *build = mj_getPluginConfig(in->m, instance, setup_keys[KEY_BUILD]);
    const char *start = mj_getPluginConfig(in->m, instance, setup_keys[KEY_START]);
    const char *copies = mj_getPluginConfig(in->m, instance, rig.build);
    state[STARTS_SPINNING] = start && !strcmp(start, "spinning");
    if (start && *start && state[STARTS_SPINNING] == 0.0 && strcmp(start, "keyframe"))
        return refuse(in, "<config key=\"start\" value=\"%.40s\">: must be keyframe or spinning", start);
    if (build && *build && strcmp(build, rig.build))
        return refuse(in, "the model was written with another library (build %.40s, and this is %s)", build, rig.build);
    if (copies && *copies)
        return refuse(in, "<config key=\"%s\">: must have no value", rig.build);
    if (!configured(in, instance, KEY_SEED, rig.seed, NOISE_LARGEST, 1, &state[SEED])) return 0;
    if (!configured(in, instance, KEY_WORLD, rig.world, NOISE_LARGEST, 1, &state[WORLD])) return 0;
    if (!configured(in, instance, KEY_NOISE, unset, most, 0, &density)) return 0;
    if (!configured(in, instance, KEY_FORCE_COUNTS, unset, most, 0, &force_counts)) return 0;
    if (!configured(in, instance, KEY_ANGLE_COUNTS, unset, most, 0, &angle_counts)) return 0;
    for (int i = 0; i < rig.axes; ++i) {
        const axis_type *axis = &rig.axis[i];
        double *settings = state + axis->settings;
        memcpy(settings, axis->unless_configured, sizeof axis->unless_configured);
        if (density >= 0.0) settings[FORCE_SIGMA] = density * 1e-6 * STANDARD_GRAVITY * sqrt(axis->raw_rate / 2.0);
        if (force_counts >= 0.0) settings[FORCE_STEP] = force_counts > 0.0 ? STANDARD_GRAVITY / force_counts : 0.0;
        if (angle_counts >= 0.0) settings[ANGLE_STEP] = angle_counts > 0.0 ? TURN / angle_counts : 0.0;
    }
    return 1;
}

/* What a plugin sensor shows, by its name: INSTANCE/AXIS/estimate, ... */

static const char *const quantities[QUANTITIES] = {
    "estimate", "command", "tilt", "gimbal_angle", "acceleration", "integrator", "sample"};

/* -1 if it is no sensor of the instance's. */
static int quantity_of(const mjModel *m, int instance, int sensor, int *which)
{
    const char *owner = instance_name(m, instance), *name = m->names + m->name_sensoradr[sensor];
    const size_t length = strlen(owner);
    if (strncmp(name, owner, length) || name[length] != '/') return -1;
    name += length + 1;
    for (int i = 0; i < rig.axes; ++i) {
        const char *prefix = rig.axis[i].prefix;
        if (strncmp(name, prefix, strlen(prefix))) continue;
        for (int quantity = 0; quantity < QUANTITIES; ++quantity)
            if (!strcmp(name + strlen(prefix), quantities[quantity])) {
                *which = i;
                return quantity;
            }
    }
    return -1;
}

static int find_shown(const search *in, int instance, double *state)
{
    const mjModel *m = in->m;
    int which = 0;
    for (int i = 0; i < rig.axes; ++i)
        for (int quantity = 0; quantity < QUANTITIES; ++quantity) state[rig.axis[i].shows + quantity] = -1.0;
    for (int i = 0; i < m->nsensor; ++i) {
        if (m->sensor_type[i] != mjSENS_PLUGIN || m->sensor_plugin[i] != instance) continue;
        const int quantity = quantity_of(m, instance, i, &which);
        if (quantity < 0)
            return refuse(in, "sensor '%s': must be named '%s/' and, of several axes, 'AXIS/', and then estimate, "
                "command, tilt, gimbal_angle, acceleration, integrator or sample", m->names + m->name_sensoradr[i],
                instance_name(m, instance));
        state[rig.axis[which].shows + quantity] = m->sensor_adr[i];
    }
    return 1;
}

int setup(const mjModel *m, int instance, double *state, char message[MESSAGE])
{
    const char *name = instance_name(m, instance);
    const search in = {m, name, prefix_length(name), message};
    const double step = m->opt.timestep, steps = floor(rig.instant / step + 0.5);
    memset(state, 0, 2 * (size_t)rig.size * sizeof *state);
    if (in.prefix_length < 0) return refuse(&in, "the instance must be named '%s', or PREFIX%s", INSTANCE, INSTANCE);
    if (m->opt.disableflags & mjDSBL_SENSOR) return refuse(&in, "<flag sensor=\"disable\"/> leaves the controller blind");
    if (m->opt.disableflags & mjDSBL_ACTUATION) return refuse(&in, "<flag actuation=\"disable\"/> holds its drives");
    if (!(steps >= 1.0 && fabs(steps * step - rig.instant) <= 1e-9 * rig.instant))
        return refuse(&in, "a physics step of %g s: must divide %g s", step, rig.instant);
    for (int i = 0; i < rig.inputs; ++i)
        if (!find_input(&in, &rig.input[i], &state[rig.from + i])) return 0;
    for (int i = 0; i < rig.axes; ++i)
        if (!find_modules(&in, &rig.axis[i], state)) return 0;
    if (!find_shown(&in, instance, state) || !configure(&in, instance, state)) return 0;
    state[STATUS] = READY;
    state[PER_INSTANT] = steps;
    state[TIMESTEP] = step;
    state[CHECK] = state_constants(state);
    return 1;
}

void spin(const mjModel *m, mjData *d, int instance)
{
    char message[MESSAGE];
    const char *name = instance_name(m, instance);
    const search in = {m, name, prefix_length(name), message};
    for (int i = 0; i < rig.axes; ++i) {
        const axis_type *axis = &rig.axis[i];
        for (int j = 0; j < axis->gimbals; ++j) {
            const module_type *module = &axis->modules[j];
            const int gimbal = find(&in, mjOBJ_JOINT, "joint", module->name, "/gimbal");
            const int flywheel = find(&in, mjOBJ_JOINT, "joint", module->name, "/flywheel");
            const int servo = find(&in, mjOBJ_ACTUATOR, "actuator", module->name, "/gimbal_servo");
            if (gimbal < 0 || flywheel < 0 || servo < 0) continue; /* cannot be: `setup` has looked */
            d->qpos[m->jnt_qposadr[gimbal]] = d->act[m->actuator_actadr[servo]] = module->zero;
            d->qvel[m->jnt_dofadr[gimbal]] = 0.0;
            d->qvel[m->jnt_dofadr[flywheel]] = module->speed;
        }
    }
}

int shown_size(const mjModel *m, int instance, int sensor)
{
    int which = 0;
    const int quantity = quantity_of(m, instance, sensor, &which);
    return quantity < 0 ? 0 : quantity == ESTIMATE ? rig.axis[which].estimates : 1;
}

void show(const mjModel *m, const double *state, double *sensordata)
{
    static const int PLACE[QUANTITIES] = {
        SHOWN_ESTIMATE, SHOWN_U, SHOWN_Y1, SHOWN_Y2, SHOWN_ACCELERATION, SHOWN_X_E, 0};
    for (int i = 0; i < rig.axes; ++i) {
        const axis_type *axis = &rig.axis[i];
        for (int quantity = 0; quantity < QUANTITIES; ++quantity) {
            const int n = quantity == ESTIMATE ? axis->estimates : 1;
            const int place = element(state[axis->shows + quantity], (int)m->nsensordata - n + 1);
            if (place < 0) continue;
            if (quantity == SAMPLE) sensordata[place] = floor(state[STEPS] / state[PER_INSTANT] / rig.period);
            else memcpy(sensordata + place, state + axis->shown + PLACE[quantity], (size_t)n * sizeof *state);
        }
    }
}
