/* The rig, whose numbers and formulas rig.c has, which is generated; and the layout of an instance's plugin_state.
 *
 * The state is a head and what the rig's places tell, and the same once more, as it will be when the step is taken.
 * Every memory lies there. Times are in instants: the greatest common divisor of the control period and all that the
 * sensors do. */
#ifndef CMG_MJ_RIG_H
#define CMG_MJ_RIG_H

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

/* Quantities of plugin sensors, and what is shown of an axis: five numbers, then the estimate. */
enum { ESTIMATE, COMMAND, TILT, GIMBAL, ACCELERATION, INTEGRATOR, SAMPLE, QUANTITIES };
enum { SHOWN_Y1, SHOWN_Y2, SHOWN_ACCELERATION, SHOWN_U, SHOWN_X_E, SHOWN_ESTIMATE };

/* Numbers of an axis that a model's <config> may change. */
enum { FORCE_SIGMA, FORCE_STEP, ANGLE_STEP, SETTINGS };

typedef struct {
    const char *name;  /* MODULE, before /gimbal_servo and the others */
    double direction;  /* sign of u that the gimbal is given */
    double speed;      /* of the flywheel [rad/s] */
    double zero;       /* gimbal angle at which the flywheel's axis is upright [rad] */
} module_type;

typedef struct {
    const char *prefix; /* before the names of its sensors: empty, or AXIS/ */
    int gimbals, estimates;
    const module_type *modules; /* one a gimbal */
    double rate_limit; /* [rad/s] */
    double raw_rate;   /* samples a second inside the accelerometers */
    double unless_configured[SETTINGS]; /* [m/s^2, m/s^2, rad] */
    int servos, motors; /* places of the actuators' numbers, one a gimbal */
    int shows;          /* place of the places in sensordata of what plugin sensors show, -1 where there is none */
    int settings, shown;
} axis_type;

/* A number that the controller takes from MuJoCo. */
typedef struct {
    const char *name; /* of a sensor, or of a joint, whose rate it is */
    int is_rate;
    int kind;   /* the sensor's, or the joint's */
    int offset; /* behind its first number */
} input_type;

/* A recorded formula, of the state and a signal, to a signal. */
typedef void formula(double *s, const double *x, double *y);

/* A sensor: cmg_mj/core/sensor.py. */
typedef struct {
    int channels, width; /* numbers of a sample, and of a reading */
    int period, raw;     /* from one reading to the next; from one sample inside the part to the next */
    int skew;            /* by which the second half of a sample is older */
    int latency;
    int settling; /* samples at rest before the first reading */
    int kept, older_kept;
    int readings, older; /* places of the last ones, the newest first */
    int delivered;
    formula *ideal, *init, *take; /* what a perfect one shows; the first sample; a sample after others */
} sensor_type;

typedef struct {
    const char *plugin; /* name under which MuJoCo knows it */
    const char *build;  /* by which a model knows the library that it was written with */
    double seed, world; /* unless the model says otherwise */
    double instant;     /* [s] */
    int period;         /* instants from one decision to the next */
    int settled;        /* the instant from which on no memory is trimmed */
    int axes, sensors, inputs, streams;
    int from;       /* place of the places of the inputs in sensordata and qvel; then come others that stay, */
    int held, rate; /* up to the rates of the gimbals until this instant, and from it on [rad/s] */
    int taken;      /* place of the inputs of this instant */
    int shown, memory, noise, size; /* places in this order: what is shown, what the decisions remember, generators */
    const axis_type *axis;
    const sensor_type *sensor;
    const input_type *input;
    const int *stream;
    formula *first, *trimmed, *later; /* decisions; their signals are none */
} rig_type;

extern const rig_type rig;

/* The number of an element in the state, whatever a program has written there; -1 if there is none. */
int element(double number, int n);

/* Sum of the numbers that stay as they are from one reset to the next. */
double state_constants(const double *s);

/* Whether a program has left alone what tells the plugin where it is and what it drives. */
int state_is_intact(const double *s);

/* Whether an axis' gimbals may turn at a rate: never faster than the law's limit, but for what rounding adds. */
int is_rate(int axis, double rate);

/* Whether all memory is finite. */
int state_is_finite(const double *s);

/* Take the samples, and the decision if it is time for one, from the inputs in the state; 0 if that failed. */
int state_advance(double *s);

#endif
