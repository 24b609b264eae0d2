/* The board in the loop: it takes what the sensors show over the serial line, runs the exported controller, and answers
 * with what the controller decided and what that took.
 *
 * A message, either way: 0xA5, its kind, its number, the length of what it carries, that, CRC-16/CCITT of all but the
 * first byte (low byte first). The board answers every message under the same kind and number, or with the kind '?' if it
 * does not know it or it came damaged. Numbers are little-endian; a real is what the controller calculates with.
 *
 *   kind  carries                                            answered by
 *   'h'   -                                                  cycles a second of its counter, its time [us] (2 uint32), and
 *                                                            who it is, in words: IDENTITY, the board
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
 * Its first message, '!', nobody has asked for: the board is ready. It carries why the board began, a byte of port.h's. The
 * emulated board must not be sent anything before that. Until the first 's' the board answers a 'u' with '!' too: where a
 * board starts again in the middle of a run and its '!' is lost, the next sample brings another.
 *
 * A message that comes again (the same number and check as the last one) is answered again and not executed again: the
 * answer may have been lost. A 'u' whose number lies behind the last one is neither. After bytes that were lost or damaged
 * the board looks for the next message in what it has already received. Once the line has been quiet for GAP_US, the rest of
 * a message does not come any more: the board drops what it has. Only then does it send '?', so that it never talks into
 * what is still on its way, and only where no message has come whole since.
 *
 * A cost is two uint32: counts of port_cycles, and bytes of stack. */
#include <string.h>

#include "its.h"
#include "port.h"

#ifndef IDENTITY
#define IDENTITY ""
#endif
#ifndef QUIET_US
#define QUIET_US 0 /* how long nobody may talk before the board starts again; 0: for ever */
#endif

#ifndef GAP_US
#define GAP_US (1000u + 4u * 10u * 1000000u / BAUD) /* four bytes' time more than a frame of USB, which may split a message */
#endif

enum { FIRST = 0xa5, LONGEST = 255, AROUND = 6, PAINT = 0x5aa5c33c };
enum { A_WHILE_US = 1000000 };

static ITS(_controller) controller;
static ITS(_state) observer;
static const uint8_t *message; /* what it carries */
static uint8_t answer[LONGEST];
static uint32_t answered; /* bytes of it */

enum { BOARDS_NAME = 24 }; /* longest */
enum { IT_IS_SHORT = 1 / (2 * sizeof(uint32_t) + sizeof IDENTITY " board=" + BOARDS_NAME <= LONGEST) };
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

static void introduce(void)
{
    const uint32_t numbers[2] = {port_cycles_a_second, port_time()};
    static const char identity[] = IDENTITY " board=";

    put(numbers, sizeof numbers);
    put(identity, sizeof identity - 1);
    put(port_name, strlen(port_name));
}

/* Whether there is such a message, so long. */
static int is_known(uint8_t kind, uint8_t length)
{
    switch (kind) {
    case 'h':
    case 'i':
    case 's':
    case 'e':
    case 'c':
        return length == 0;
    case 'u':
        return length == (4 + ENCODERS) * sizeof(real);
    case 'n':
        return length == 3 * sizeof(real);
    case 'o':
        return length == 4 * sizeof(real);
    default:
        return 0;
    }
}

static void handle(uint8_t kind)
{
    switch (kind) {
    case 'h':
        introduce();
        break;
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

/* ---- The line ---- */

static uint16_t check_of(const uint8_t *bytes, uint32_t count)
{
    uint16_t crc = 0xffff;
    int bit;

    while (count--) {
        crc ^= (uint16_t)(*bytes++ << 8);
        for (bit = 0; bit < 8; bit++)
            crc = (uint16_t)(crc & 0x8000u ? crc << 1 ^ 0x1021 : crc << 1);
    }
    return crc;
}

static void reply(uint8_t kind, uint8_t number, const void *carries, uint32_t length)
{
    static uint8_t whole[LONGEST + AROUND];
    uint16_t check;

    whole[0] = FIRST;
    whole[1] = kind;
    whole[2] = number;
    whole[3] = (uint8_t)length;
    memcpy(whole + 4, carries, length);
    check = check_of(whole + 1, length + 3);
    whole[4 + length] = (uint8_t)check;
    whole[5 + length] = (uint8_t)(check >> 8);
    port_write(whole, length + AROUND);
}

static uint8_t why_begun; /* port_init has said it */
static int is_started;    /* by an 's' */

static void announce(void)
{
    reply('!', 0, &why_begun, why_begun ? 1 : 0);
}

static void take(uint8_t kind, uint8_t number, uint32_t check)
{
    static uint32_t last_check = 0x10000; /* no message has it */
    static uint8_t last;

    is_started |= kind == 's';
    if (kind == 'u' && !is_started) {
        announce();
        return;
    }
    if (check != last_check || number != last) {
        if (kind == 'u' && (uint8_t)(number - last) > 127)
            return; /* an old one that comes late */
        answered = 0;
        handle(kind);
        last_check = check;
        last = number;
    }
    reply(kind, number, answer, answered);
}

static uint8_t line[LONGEST + AROUND]; /* what has come and is not dealt with */
static uint32_t held;                  /* bytes of it */

static uint8_t refused;                /* number of the first message that came damaged */
static int is_refused;                 /* there is one, and none has come whole since */

static void drop(uint32_t count)
{
    held -= count;
    memmove(line, line + count, held);
}

/* Gives up what the line begins with, and goes to where a message may begin behind it. */
static void skip(void)
{
    uint32_t next = 1;

    if (line[0] == FIRST && held > 2 && !is_refused) {
        refused = line[2];
        is_refused = 1;
    }
    while (next < held && line[next] != FIRST)
        next++;
    drop(next);
}

/* Deals with every message that has come whole. */
static void deal(void)
{
    while (held) {
        const uint32_t length = line[3];
        uint32_t check;

        if (line[0] == FIRST) {
            if (held < 4)
                return;
            if (is_known(line[1], line[3])) {
                if (held < length + AROUND)
                    return;
                check = line[4 + length] | (uint32_t)line[5 + length] << 8;
                if (check == check_of(line + 1, length + 3)) {
                    is_refused = 0;
                    message = line + 4;
                    take(line[1], line[2], check);
                    drop(length + AROUND);
                    continue;
                }
            }
        }
        skip();
    }
}

/* The line is quiet. A whole message may lie behind the beginning of another. */
static void settle(void)
{
    while (held) {
        skip();
        deal();
    }
    if (is_refused)
        reply('?', refused, "", 0);
    is_refused = 0;
}

int main(void)
{
    why_begun = (uint8_t)port_init();
    ITS(_start)(&controller);
    announce();
    for (;;) {
        const int is_amid = held || is_refused;

        if (port_read(line + held, is_amid ? GAP_US : QUIET_US ? QUIET_US : A_WHILE_US)) {
            held++;
            deal();
        } else if (is_amid) {
            settle();
        } else if (QUIET_US) {
            port_reset(NOBODY_TALKS);
        }
        (void)port_time(); /* asked often enough that it misses no turn of the counter */
    }
}
