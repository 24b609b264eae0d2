#include "noise.h"

#include "ziggurat.h"

#include <math.h>
#include <stdint.h>

__extension__ typedef unsigned __int128 uint128;

/* Where the lowest layer ends and the tail begins. */
static const double TAIL = 3.6541528853610088;
static const double INVERSE_TAIL = 0.27366123732975828;

static const uint128 MULTIPLIER = (uint128)UINT64_C(0x2360ED051FC65DA4) << 64 | UINT64_C(0x4385DF649FCCF645);

typedef struct {
    uint128 state, increment;
} pcg64;

/* Whatever a program has written there counts as an integer of 32 bits. */
static uint32_t word(double number)
{
    return number >= 0.0 && number <= 4294967295.0 ? (uint32_t)number : 0;
}

static uint128 joined(const double words[4])
{
    uint128 value = 0;
    for (int i = 3; i >= 0; --i) value = value << 32 | word(words[i]);
    return value;
}

static void split(uint128 value, double words[4])
{
    for (int i = 0; i < 4; ++i, value >>= 32) words[i] = (uint32_t)value;
}

/* PCG XSL RR 128/64 (M. E. O'Neill). */
static uint64_t next(pcg64 *generator)
{
    const uint128 state = generator->state * MULTIPLIER + generator->increment;
    const uint64_t folded = (uint64_t)(state >> 64) ^ (uint64_t)state;
    const unsigned turn = (unsigned)(state >> 122);
    generator->state = state;
    return folded >> turn | folded << (-turn & 63u);
}

/* Uniform from 0 up to 1. */
static double uniform(pcg64 *generator)
{
    return (double)(next(generator) >> 11) * (1.0 / 9007199254740992.0);
}

/* Ziggurat method (G. Marsaglia, W. W. Tsang) as in NumPy's random_standard_normal. */
static double normal(pcg64 *generator)
{
    for (;;) {
        const uint64_t bits = next(generator);
        const int layer = (int)(bits & 0xff);
        const int negative = (int)(bits >> 8 & 1);
        const uint64_t size = bits >> 9 & UINT64_C(0x000fffffffffffff);
        double x = (double)size * ziggurat_width[layer];
        if (negative) x = -x;
        if (size < ziggurat_inside[layer]) return x;
        if (layer == 0) {
            for (;;) {
                const double beyond = -INVERSE_TAIL * log1p(-uniform(generator));
                const double y = -log1p(-uniform(generator));
                if (y + y > beyond * beyond) return (size >> 8 & 1) ? -(TAIL + beyond) : TAIL + beyond;
            }
        }
        const double span = ziggurat_height[layer - 1] - ziggurat_height[layer];
        if (span * uniform(generator) + ziggurat_height[layer] < exp(-0.5 * x * x)) return x;
    }
}

/* SeedSequence's hash (M. E. O'Neill's seed_seq), which changes its constant at every use. */
static uint32_t hashed(uint32_t value, uint32_t *constant, uint32_t multiplier)
{
    value ^= *constant;
    *constant *= multiplier;
    value *= *constant;
    return value ^ value >> 16;
}

static uint32_t mixed(uint32_t x, uint32_t y)
{
    const uint32_t result = UINT32_C(0xca01f9dd) * x - UINT32_C(0x4973f715) * y;
    return result ^ result >> 16;
}

/* The words of an integer, at least one; returns how many. */
static int words_of(double value, uint32_t words[2])
{
    const uint64_t integer = value >= 0.0 && value <= NOISE_LARGEST ? (uint64_t)value : 0;
    words[0] = (uint32_t)integer;
    words[1] = (uint32_t)(integer >> 32);
    return words[1] ? 2 : 1;
}

static void seed_words(double seed, double world, int stream, uint32_t words[8])
{
    enum { POOL = 4 };
    uint32_t entropy[POOL + 3] = {0}, pool[POOL]; /* the seed fills the pool's size with zeros before the key */
    uint32_t constant = UINT32_C(0x43b0d7e5);
    const uint32_t multiplier = UINT32_C(0x931e8875);
    int n = POOL;
    (void)words_of(seed, entropy);
    n += words_of(world, entropy + n);
    entropy[n++] = (uint32_t)stream;
    for (int i = 0; i < POOL; ++i) pool[i] = hashed(entropy[i], &constant, multiplier);
    for (int from = 0; from < POOL; ++from)
        for (int to = 0; to < POOL; ++to)
            if (from != to) pool[to] = mixed(pool[to], hashed(pool[from], &constant, multiplier));
    for (int from = POOL; from < n; ++from)
        for (int to = 0; to < POOL; ++to) pool[to] = mixed(pool[to], hashed(entropy[from], &constant, multiplier));
    constant = UINT32_C(0x8b51f9dd);
    for (int i = 0; i < 8; ++i) words[i] = hashed(pool[i % POOL], &constant, UINT32_C(0x58f38ded));
}

void noise_start(double generator[NOISE_WORDS], double seed, double world, int stream)
{
    uint32_t words[8];
    uint64_t pairs[4];
    seed_words(seed, world, stream, words);
    for (int i = 0; i < 4; ++i) pairs[i] = words[2 * i] | (uint64_t)words[2 * i + 1] << 32;
    pcg64 rng = {0, ((uint128)pairs[2] << 64 | pairs[3]) << 1 | 1};
    (void)next(&rng);
    rng.state += (uint128)pairs[0] << 64 | pairs[1];
    (void)next(&rng);
    split(rng.state, generator);
    split(rng.increment, generator + 4);
}

void noise_normals(double generator[NOISE_WORDS], double *normals, int n)
{
    pcg64 rng = {joined(generator), joined(generator + 4)};
    for (int i = 0; i < n; ++i) normals[i] = normal(&rng);
    split(rng.state, generator);
}

double noise_mean(
    double generator[NOISE_WORDS], int width, void (*step)(double *memory, const double *normals, double *result),
    double *memory, int samples, int piece)
{
    double normals[width], result, mean = 0.0;
    for (int from = 0; from < samples; from += piece) {
        double sum = 0.0;
        for (int i = 0; i < piece && from + i < samples; ++i) {
            noise_normals(generator, normals, width);
            step(memory, normals, &result);
            sum = i ? sum + result : result;
        }
        mean = mean + sum / samples;
    }
    return mean;
}
