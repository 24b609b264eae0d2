/* The board in the loop: it takes what the sensors show over the serial line, runs the exported controller, and answers
 * with what the controller decided and what that took.
 *
 * A message, either way: 0xA5, its kind, its number, the length of what it carries, that, CRC-16/CCITT of all but the
 * first byte (low byte first). The board answers every message under the same kind and number, or with the kind '?' if it
 * does not know it or it came damaged. Numbers are little-endian; a real is what the controller calculates with.
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
 * Its first message, '!', nobody has asked for: the board is ready. Before that nothing may be sent.
 *
 * A cost is two uint32: counts of machine_time, and bytes of stack. */
#include <string.h>

#include "its.h"
#include "machine.h"

enum { FIRST = 0xa5, LONGEST = 255, PAINT = 0x5aa5c33c };

static ITS(_controller) controller;
static ITS(_state) observer;
static uint8_t message[LONGEST];
static uint8_t answer[LONGEST];
static uint32_t answered; /* bytes of it */

enum { IT_FITS = 1 / (3 * sizeof(uint32_t) + (2 + ESTIMATES) * sizeof(real) <= LONGEST) };

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
        machine_halt(STACK_FULL);
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
        cost[0] = machine_time();           \
        __asm volatile("" ::: "memory");    \
        WORK;                               \
        __asm volatile("" ::: "memory");    \
        cost[0] = machine_time() - cost[0]; \
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

/* Whether there is such a message, so long. */
static int handled(uint8_t kind, uint32_t length)
{
    if (kind == 'i' && length == 0)
        identify();
    else if (kind == 's' && length == 0)
        ITS(_start)(&controller);
    else if (kind == 'u' && length == (4 + ENCODERS) * sizeof(real))
        update();
    else if (kind == 'n' && length == 3 * sizeof(real))
        init();
    else if (kind == 'o' && length == 4 * sizeof(real))
        step();
    else if (kind == 'e' && length == 0)
        empty();
    else if (kind == 'c' && length == 0)
        calibrate();
    else
        return 0;
    return 1;
}

/* ---- The line ---- */

static uint16_t crc; /* of what has gone over the line since the first byte of a message */

static void counts(uint8_t byte)
{
    int bit;

    crc ^= (uint16_t)(byte << 8);
    for (bit = 0; bit < 8; bit++)
        crc = (uint16_t)(crc & 0x8000u ? crc << 1 ^ 0x1021 : crc << 1);
}

static uint8_t receive(void)
{
    const uint8_t byte = machine_receive();

    counts(byte);
    return byte;
}

static void send(uint8_t byte)
{
    counts(byte);
    machine_send(byte);
}

static void reply(uint8_t kind, uint8_t number)
{
    uint32_t i;
    uint16_t check;

    machine_send(FIRST);
    crc = 0xffff;
    send(kind);
    send(number);
    send((uint8_t)answered);
    for (i = 0; i < answered; i++)
        send(answer[i]);
    check = crc;
    machine_send((uint8_t)check);
    machine_send((uint8_t)(check >> 8));
    answered = 0;
}

int main(void)
{
    machine_start();
    ITS(_start)(&controller);
    reply('!', 0);
    for (;;) {
        uint8_t kind, number, length;
        uint32_t i, check;

        while (machine_receive() != FIRST) {
        }
        crc = 0xffff;
        kind = receive();
        number = receive();
        length = receive();
        for (i = 0; i < length; i++)
            message[i] = receive();
        check = crc;
        i = machine_receive();
        i |= (uint32_t)machine_receive() << 8;
        reply(i == check && handled(kind, length) ? kind : '?', number);
    }
}
