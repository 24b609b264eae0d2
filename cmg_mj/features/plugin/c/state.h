/* The layout of an instance's plugin_state: the head, then a block an axis; and the same once more, as it will be when
 * the step is taken. Every memory lies there. */
#ifndef CMG_MJ_STATE_H
#define CMG_MJ_STATE_H

#include "rig.h"

/* The head. A program may write SEED and WORLD before the first step. */
enum {
    SEED,
    WORLD,
    STATUS,      /* one of the states below */
    STEPS,       /* physics steps since the reset */
    PER_INSTANT, /* physics steps from one instant to the next */
    TIMESTEP,    /* physics step that the others are counted in [s] */
    IS_PENDING,  /* whether the inputs of this instant have been read and not yet been counted */
    STARTS_SPINNING, /* whether the flywheels are set going at the start */
    IS_SPINNING_UP,  /* while this is being done */
    CHECK,       /* sum of the numbers that `setup` has written and nothing changes: see `state_constants` */
    HEAD
};
enum { BLANK, READY, FAILED, UNREADY };

/* Places of one axis. */
typedef struct {
    int forces;              /* places in sensordata of inner x, inner z, outer x, outer z */
    int encoders;            /* places in sensordata, one a gimbal */
    int servos, motors;      /* numbers of the actuators, one a gimbal */
    int shows;               /* places in sensordata of what plugin sensors show, -1 where there is none */
    int settings;            /* force sigma, force step, angle step */
    int held, rate;          /* rate of the gimbals until this instant, and from it on [rad/s] */
    int inputs;              /* of this instant: ideal forces, then ideal gimbal angles */
    int gyro_from, gyro;     /* place in sensordata, and input, of a gyro that is fed back or observed [rad/s] */
    int rates_from, rates;   /* places in qvel, and inputs, of a true rate that is fed back */
    int coriolis;            /* of the decision before, on a rig that turns [rad/s^2] */
    int shown;               /* y1, y2, acceleration, u, x_e, then the estimate, at the last decision */
    pair_places pair;
    delivery_places encoder;
    fog_places fog;
    mems_gyro_places mems_gyro;
    controller_places controller;
} axis_places;

enum { SHOWN_Y1, SHOWN_Y2, SHOWN_ACCELERATION, SHOWN_U, SHOWN_X_E, SHOWN_ESTIMATE };

/* Quantities of plugin sensors. */
enum { ESTIMATE, COMMAND, TILT, GIMBAL, ACCELERATION, INTEGRATOR, SAMPLE, QUANTITIES };

/* Places of the rig as a whole, behind those of the axes, if its turns are compensated. */
typedef struct {
    int rate_from, rate; /* place in sensordata, and input, of the rate about the vertical [rad/s] */
    mems_gyro_places gyro;
} turning_places;

/* Whether a gyro along the tilt axis is read. */
int reads_gyro(const axis_type *axis);

/* Each returns the first place behind the block. */
int axis_place(const axis_type *axis, int at, axis_places *places);
int turning_place(const turning_type *turning, int at, turning_places *places);

/* The number of an element in the state, whatever a program has written there; -1 if there is none. */
int element(double number, int n);

/* Numbers in one half of the state. */
int state_size(const rig_type *type);

/* Sum of the numbers that stay as they are from one reset to the next. */
double state_constants(const rig_type *type, const double *state);

/* Whether a program has left alone what tells the plugin where it is and what it drives. */
int state_is_intact(const rig_type *type, const double *state);

/* Whether gimbals may turn at a rate: never faster than the law's limit, but for what rounding adds. */
int is_rate(const axis_type *axis, double rate);

/* Whether all memory is finite. */
int state_is_finite(const rig_type *type, const double *state);

/* Take the samples, and the decision if it is time for one, from the inputs in the state; 0 if that failed. */
int state_advance(const rig_type *type, double *state);

#endif
