/* One axis' controller: measurement, observer, trim and law, as cmg_mj/core/controller.py decides. */
#ifndef CMG_MJ_CONTROLLER_H
#define CMG_MJ_CONTROLLER_H

enum { MOST_ESTIMATES = 64 };

/* Which rate the law uses: the observer's, the gyro's or the true one. */
enum { FEEDBACK_OBSERVER, FEEDBACK_FOG, FEEDBACK_TRUTH };

/* What is exported of a controller, and its numbers; the functions are those of the exported C. */
typedef struct {
    int estimates;    /* parts of an estimate */
    int observer;     /* numbers in the observer's state */
    int law;          /* numbers in the law's state */
    int integrator;   /* which of them is the integrator [rad s]; -1: it has none */
    int trimmed;      /* decisions during which the integrator is trimmed */
    int trim_part;    /* part of the estimate that it is trimmed with */
    double trim_gain; /* [s] */
    int angles_are_estimated;
    int feedback; /* one of the above */
    int reads_gyro; /* whether the observer needs the cheap gyro */
    double rate_limit; /* [rad/s] */
    int has_backlash;
    double half_gap; /* [rad] */
    double period;   /* from one decision to the next [s] */
    void (*measure)(const double *forces, const double *encoders, double y[3]);
    void (*observer_init)(double *state, const double y[4]);
    void (*observer_step)(double *state, const double y[4], double u, double *estimate);
    void (*law_init)(double *state, const double y[3]);
    void (*law_step)(double *state, const double y[3], const double *x, double held, double *u);
} controller_type;

typedef struct {
    int decisions; /* so far */
    int u;         /* last command [rad/s] */
    int law, observer;
    int motor, gimbal; /* of the play between them, if there is some [rad] */
} controller_places;

typedef struct {
    double y[4]; /* tilt, gimbal angle, acceleration of the tilt; the cheap gyro's reading */
    double u;    /* command [rad/s] */
    double rate; /* tilt rate that was fed back [rad/s] */
    double x_e;  /* integrator that went into it [rad s] */
    double estimate[MOST_ESTIMATES];
} decision;

/* Returns the first place behind the controller's memory. */
int controller_place(const controller_type *controller, int at, controller_places *places);

/* What the sensors have delivered. */
typedef struct {
    const double *forces, *encoders;
    double rate;     /* of the gyro, or the true one, if that is fed back [rad/s] */
    double coriolis; /* part of the measured acceleration that is none [rad/s^2] */
    double gyro;     /* reading of the cheap one, if it is read [rad/s] */
} controller_inputs;

/* Decide on one sample; 0 if the observer or the law gave no finite number. */
int controller_decide(
    const controller_type *controller, const controller_places *places, double *memory, const controller_inputs *inputs,
    decision *result);

/* Rate at which the gimbals turn under a command [rad/s]. */
double controller_gimbal_rate(
    const controller_type *controller, const controller_places *places, double *memory, double u);

#endif
