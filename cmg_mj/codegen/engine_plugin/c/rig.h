/* The rig and its controllers, whose numbers the generated files hold: rig.c, and NAME_controller.c for each axis. */
#ifndef CMG_MJ_RIG_H
#define CMG_MJ_RIG_H

#include "controller.h"
#include "sensors.h"

typedef struct {
    const char *name;  /* MODULE, before /gimbal_servo and the others */
    double direction;  /* sign of u that the gimbal is given */
    double speed;      /* of the flywheel [rad/s] */
} module_type;

typedef struct {
    const char *prefix; /* before the names of its sensors: empty, or AXIS/ */
    int gimbals;
    module_type modules[MOST_GIMBALS];
    pair_type pair;
    encoder_type encoder;
    double raw_rate; /* samples a second inside the accelerometers */
    sensor_settings settings;
    const controller_type *controller;
} axis_type;

typedef struct {
    const char *plugin; /* name under which MuJoCo knows it */
    const char *build;  /* by which a model knows the library that it was written with */
    double seed, world; /* unless the model says otherwise */
    double instant;     /* [s] */
    int period;         /* instants from one decision to the next */
    int axes;
    const axis_type *const *axis;
} rig_type;

extern const rig_type rig;

#endif
