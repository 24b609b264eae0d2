/* The emulated board in the loop: it takes what the sensors show over the serial line, runs the exported controller, and
 * answers with what the controller decided and what that took.
 *
 * A message is its kind and what it carries; the answer is the same kind and what it carries. Nothing is lost on this line.
 * Numbers are little-endian; a real is what the controller calculates with.
 *
 *   kind  carries                                            answered by
 *   'i'   -                                                  sizes in bytes: a real, the observer, the controller;
 *                                                            parts of an estimate (4 uint32)
 *   's'   -                                                  - (the controller is at its start)
 *   'u'   inner x, z, outer x, z [m/s^2], encoders [rad]     cost, the status (uint32), u [rad/s], the integrator
 *                                                            before that [rad s], the estimate
 *   'n'   y1, y2 [rad], acceleration [rad/s^2]               cost (the observer is at its start)
 *   'o'   the same and u [rad/s]                             cost, the estimate
 *   'e'   -                                                  costs of empty functions called as 'u', 'n', 'o' are
 *   'c'   -                                                  costs of no, 100, 1000 instructions in a row
 *
 * Its first byte, '!', nobody has asked for: the board is ready, and must not be sent anything before that.
 *
 * A cost is two uint32: counts of port_cycles, and bytes of stack. */
#include <string.h>

#include "its.h"
#include "port.h"

enum { LONGEST = 255, PAINT = 0x5aa5c33c };

static ITS(_controller) controller;
static ITS(_state) observer;
static uint8_t line[LONGEST];
static const uint8_t *message; /* what it carries */
static uint8_t answer[LONGEST];
static uint32_t answered; /* bytes of it */

enum { IT_FITS = 1 / (1 + 3 * sizeof(uint32_t) + (2 + ESTIMATES) * sizeof(real) <= LONGEST) };

/* ---- What a piece of work takes ---- */

extern uint32_t stack_bottom[];

#define STACK_POINTER(where) __asm volatile("mov %0, sp" : "=r"(where)::"memory")

/* Inline: a function of its own would have its frame on what it paints. */
__attribute__((always_inline)) static inline void paint(void)
{
    uint32_t *here, *word;

    STACK_POINTER(here);
    for (word = stack_bottom; word < here; word++)
        *(volatile uint32_t *)word = PAINT;
}

__attribute__((always_inline)) static inline uint32_t depth(void)
{
    const uint32_t *here, *word = stack_bottom;

    STACK_POINTER(here);
    if (*(const volatile uint32_t *)word != PAINT)
        port_reset(STACK_FULL);
    while (word < here && *(const volatile uint32_t *)word == PAINT)
        word++;
    return (uint32_t)(here - word) * 4u;
}

static void put(const void *from, uint32_t bytes)
{
    memcpy(answer + answered, from, bytes);
    answered += bytes;
}

/* Does WORK and puts its cost into the answer. Between the two looks at the clock there is nothing else. */
#define COST(WORK)                          \
    do {                                    \
        uint32_t cost[2];                   \
        paint();                            \
        cost[0] = port_cycles();           \
        __asm volatile("" ::: "memory");    \
        WORK;                               \
        __asm volatile("" ::: "memory");    \
        cost[0] = port_cycles() - cost[0]; \
        cost[1] = depth();                  \
        put(cost, sizeof cost);             \
    } while (0)

#define EMPTY __attribute__((noipa)) static void

__attribute__((noipa)) static ITS(_status) empty_update(ITS(_controller) *c, const real *a, const real *e,
                                                        real *estimate, real *u)
{
    ITS(_status) status;

    __asm volatile("" : "=r"(status) : "r"(c), "r"(a), "r"(e), "r"(estimate), "r"(u) : "memory");
    return status;
}

EMPTY empty_init(ITS(_state) *s, real y1, real y2, real acceleration)
{
    __asm volatile("" ::"r"(s), "t"(y1), "t"(y2), "t"(acceleration) : "memory");
}

EMPTY empty_step(ITS(_state) *s, real y1, real y2, real acceleration, real u, real *estimate)
{
    __asm volatile("" ::"r"(s), "t"(y1), "t"(y2), "t"(acceleration), "t"(u), "r"(estimate) : "memory");
}

/* ---- Messages ---- */

static void update(void)
{
    const real x_e = controller.x_e;
    real shown[4 + ENCODERS], estimate[ESTIMATES], u;
    ITS(_status) status;
    uint32_t word;

    memcpy(shown, message, sizeof shown);
    COST(status = ITS(_update)(&controller, shown, shown + 4, estimate, &u));
    word = (uint32_t)status;
    put(&word, sizeof word);
    put(&u, sizeof u);
    put(&x_e, sizeof x_e);
    put(estimate, sizeof estimate);
}

static void init(void)
{
    real y[3];

    memcpy(y, message, sizeof y);
    COST(ITS(_init)(&observer, y[0], y[1], y[2]));
}

static void step(void)
{
    real y[4], estimate[ESTIMATES];

    memcpy(y, message, sizeof y);
    COST(ITS(_step)(&observer, y[0], y[1], y[2], y[3], estimate));
    put(estimate, sizeof estimate);
}

static void empty(void)
{
    real y[4 + ENCODERS] = {0}, estimate[ESTIMATES], u;
    ITS(_status) status;

    COST(status = empty_update(&controller, y, y + 4, estimate, &u));
    __asm volatile("" ::"r"(status)); /* it is kept, as in update */
    COST(empty_init(&observer, y[0], y[1], y[2]));
    COST(empty_step(&observer, y[0], y[1], y[2], y[3], estimate));
}

static void calibrate(void)
{
    COST(;);
    COST(__asm volatile(".rept 100\n\tnop\n\t.endr"));
    COST(__asm volatile(".rept 1000\n\tnop\n\t.endr"));
}

static void identify(void)
{
    const uint32_t sizes[4] = {sizeof(real), sizeof observer, sizeof controller, ESTIMATES};

    put(sizes, sizeof sizes);
}

/* What a message of this kind carries [bytes]. */
static uint32_t length_of(uint8_t kind)
{
    switch (kind) {
    case 'u':
        return (4 + ENCODERS) * sizeof(real);
    case 'n':
        return 3 * sizeof(real);
    case 'o':
        return 4 * sizeof(real);
    default:
        return 0;
    }
}

/* By itself, so that what it counts hangs on nothing around it. */
__attribute__((noipa)) static void handle(uint8_t kind)
{
    switch (kind) {
    case 'i':
        identify();
        break;
    case 's':
        ITS(_start)(&controller);
        break;
    case 'u':
        update();
        break;
    case 'n':
        init();
        break;
    case 'o':
        step();
        break;
    case 'e':
        empty();
        break;
    default:
        calibrate();
    }
}

int main(void)
{
    port_init();
    ITS(_start)(&controller);
    port_write((const uint8_t *)"!", 1);
    for (;;) {
        const uint8_t kind = port_read();
        const uint32_t length = length_of(kind);
        uint32_t i;

        for (i = 0; i < length; i++)
            line[i] = port_read();
        message = line;
        answered = 0;
        put(&kind, 1);
        handle(kind);
        port_write(answer, answered);
    }
}
