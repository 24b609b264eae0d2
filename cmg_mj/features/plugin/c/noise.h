/* NumPy's normals: default_rng(SeedSequence(seed, spawn_key=(world, stream))).standard_normal, bit for bit.
 *
 * A generator is so many numbers, each an integer of 32 bits: state, then increment, the lowest word first. */
#ifndef CMG_MJ_NOISE_H
#define CMG_MJ_NOISE_H

enum { NOISE_WORDS = 8 };

/* Largest seed and world: a double holds every integer up to it. */
#define NOISE_LARGEST 9007199254740992.0

void noise_start(double generator[NOISE_WORDS], double seed, double world, int stream);
void noise_normals(double generator[NOISE_WORDS], double *normals, int n);

/* Advance a memory by so many samples of so many normals; the mean of what they give, which is summed in pieces. */
double noise_mean(
    double generator[NOISE_WORDS], int width, void (*step)(double *memory, const double *normals, double *result),
    double *memory, int samples, int piece);

#endif
