/* Gyros, bit for bit those of cmg_mj/sensors: the fibre-optic one that a law may be fed back, and the cheap one about
 * the vertical, against whose rate the gimbals of several axes are turned, or about a tilt axis. */
#ifndef CMG_MJ_GYROS_H
#define CMG_MJ_GYROS_H

#include "sensors.h"

typedef struct {
    int stream;
    int period;
    double share; /* of a step that the low-pass has taken after a sample */
    double bias, sigma, limit; /* [rad/s] */
    delivery_type delivery;
} fog_type;

typedef struct {
    int noise, has_sampled, passed;
    delivery_places delivery;
} fog_places;

typedef struct {
    int stream, part_stream;
    int resting; /* samples of the mean at rest */
    int piece;   /* of them at a time */
    double sigma, limit, step, scale, bias; /* [rad/s]; scale [1] */
    int is_as_bought;
    double offset, drift; /* of a part as bought: sizes, the drift's in a sample [rad/s] */
    double flicker_sigma, decay[CORNERS], spread[CORNERS];
} mems_gyro_type;

typedef struct {
    int noise, offset, drift, samples, wander;
} mems_gyro_places;

int fog_place(const fog_type *fog, int at, fog_places *places);
void fog_sample(
    const fog_type *fog, const fog_places *places, double *memory, double seed, double world, double instant, double rate);

int mems_gyro_place(int at, mems_gyro_places *places);
double mems_gyro_read(
    const mems_gyro_type *gyro, const mems_gyro_places *places, double *memory, double seed, double world, double rate);

#endif
