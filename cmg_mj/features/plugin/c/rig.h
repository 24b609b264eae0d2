/* The rig and its controllers, whose numbers the generated files hold: rig.c, and NAME_controller.c for each axis. */
#ifndef CMG_MJ_RIG_H
#define CMG_MJ_RIG_H

#include "controller.h"
#include "gyros.h"
#include "sensors.h"

enum { MOST_AXES = 4, MOST_DOFS = 3 };

typedef struct {
    const char *name;  /* MODULE, before /gimbal_servo and the others */
    double direction;  /* sign of u that the gimbal is given */
    double speed;      /* of the flywheel [rad/s] */
    double zero;       /* gimbal angle at which the flywheel's axis is upright [rad] */
} module_type;

typedef struct {
    const char *prefix; /* before the names of its sensors: empty, or AXIS/ */
    int gimbals;
    module_type modules[MOST_GIMBALS];
    pair_type pair;
    encoder_type encoder;
    double raw_rate; /* samples a second inside the accelerometers */
    sensor_settings settings;
    fog_type fog;
    mems_gyro_type mems_gyro;
    const char *joint;        /* of the tilt; free, or a hinge */
    int dofs;                 /* of it that the tilt rate is made of */
    double shares[MOST_DOFS]; /* of them in it */
    const controller_type *controller;
} axis_type;

/* Coupling of the axes in a turn about the vertical: see YawCoupling in cmg_mj/stages/turning.py. */
typedef struct {
    mems_gyro_type gyro;
    double flywheels[MOST_AXES][MOST_AXES], inertia[MOST_AXES][MOST_AXES], coriolis[MOST_AXES][MOST_AXES];
} turning_type;

typedef struct {
    const char *plugin; /* name under which MuJoCo knows it */
    const char *build;  /* by which a model knows the library that it was written with */
    double seed, world; /* unless the model says otherwise */
    double instant;     /* [s] */
    int period;         /* instants from one decision to the next */
    int axes;
    const axis_type *const *axis;
    const turning_type *turning; /* NULL if turns are not compensated */
} rig_type;

extern const rig_type rig;

#endif
