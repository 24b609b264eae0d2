/* Finds the rig in a MuJoCo model, and reads the instance's <config>. */
#ifndef CMG_MJ_SETUP_H
#define CMG_MJ_SETUP_H

#include "rig.h"

#include <mujoco/mujoco.h>

enum { MESSAGE = 400 };

/* Keys that <config> may have. */
extern const char *const setup_keys[];
enum { SETUP_KEYS = 7 };

/* Fill a state for its first step; 0 if the model does not fit, and why. */
int setup(const mjModel *m, int instance, double *state, char message[MESSAGE]);

/* Let the flywheels turn at their speed and the gimbals stand upright, whatever the program has set. */
void spin(const mjModel *m, mjData *d, int instance);

/* Places in sensordata, and what is shown there of a state. */
int shown_size(const mjModel *m, int instance, int sensor);
void show(const mjModel *m, const double *state, double *sensordata);

#endif
