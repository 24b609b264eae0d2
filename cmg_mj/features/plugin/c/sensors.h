/* Sensors between the rig's true motion and the controller, bit for bit those of cmg_mj/sensors.
 *
 * Times are counted in instants: the greatest common divisor of the control period and all that sensors do.
 * A sensor's parameters are constant; its memory lies in the plugin's state, at the places that `..._place` counts. */
#ifndef CMG_MJ_SENSORS_H
#define CMG_MJ_SENSORS_H

enum { CORNERS = 4, FORCES = 4, MOST_GIMBALS = 8 };

/* A sensor's way from sampling to delivery. */
typedef struct {
    int width;    /* numbers a sample */
    int latency;  /* instants */
    int capacity; /* samples on the way at most; 0 without latency */
} delivery_type;

typedef struct {
    int newest;
    int delivered, has_delivered, count, queue; /* with latency alone */
} delivery_places;

/* Two accelerometers: inner x, z, outer x, z [m/s^2]. */
typedef struct {
    int noise_stream, flicker_stream;
    int spacing; /* instants between those at which it may be due */
    int period;  /* from one delivered sample to the next */
    int raw;     /* from one sample inside the part to the next */
    int skew;    /* by which the outer's sample is older */
    int settling; /* samples that the low-pass sees before the first */
    int outer_capacity;
    double limit;
    int is_distorted;
    double by_same[FORCES], by_other[FORCES], offset[FORCES];
    int is_filtered;
    double b[3], a[3]; /* low-pass */
    int has_flicker;
    double flicker_sigma, decay[CORNERS], spread[CORNERS];
    delivery_type delivery;
} pair_type;

typedef struct {
    int noise;
    int has_sampled;
    int flicker_noise, wander; /* with 1/f noise alone */
    int filter;                /* with a low-pass alone */
    int outer_count, outer;    /* with skew alone */
    delivery_places delivery;
} pair_places;

typedef struct {
    int period;
    delivery_type delivery;
} encoder_type;

/* Numbers that a model's <config> may change. */
typedef struct {
    double force_sigma; /* white noise of one sample that the accelerometers take [m/s^2] */
    double force_step;  /* resolution, 0 for none [m/s^2] */
    double angle_step;  /* resolution of the encoders, 0 for none [rad] */
} sensor_settings;

/* Each returns the first place behind the sensor's memory. */
int pair_place(const pair_type *pair, int at, pair_places *places);
int encoder_place(const encoder_type *encoder, int at, delivery_places *places);

/* Take what is due at an instant. */
void pair_sample(
    const pair_type *pair, const pair_places *places, double *memory, const sensor_settings *settings, double seed,
    double world, double instant, const double forces[FORCES]);
void encoder_sample(
    const encoder_type *encoder, const delivery_places *places, double *memory, const sensor_settings *settings,
    double instant, const double *angles);

double clip(double x, double low, double high);

/* What all sensors have in common: whether one is due, and delivery; the newest sample that has been delivered. */
int is_due(double instant, int period);
int delivery_place(const delivery_type *delivery, int at, delivery_places *places);
void deliver(
    const delivery_type *delivery, const delivery_places *places, double *memory, double instant, const double *reading);
void delivery_read(
    const delivery_type *delivery, const delivery_places *places, double *memory, double instant, double *reading);

#endif
