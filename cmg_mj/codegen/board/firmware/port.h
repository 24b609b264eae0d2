/* The firmware's port layer: six functions and two constants are all that differs from board to board. mps2.c has them for
 * QEMU's mps2-an500, stm32f746.c for ST's 32F746GDISCOVERY; docs/port_a_board.md says how to write another. */
#ifndef PORT_H
#define PORT_H

#include <stdint.h>

#ifndef BAUD
#define BAUD 460800u /* of the line, where it has a rate */
#endif

/* Why a board starts again: port_init returns it, the host is told. The first is the power, or the reset button. */
enum { NOBODY_TALKS = 0, FAULT = 101, STACK_FULL = 102 };

extern const char port_name[];              /* the board's name: at most 24 letters, digits, _ and - */
extern const uint32_t port_cycles_a_second; /* the rate at which port_cycles counts; 0 if it does not measure time */

int port_init(void);                                      /* once, before the rest: clock, line, counters */
int port_read(uint8_t *byte, uint32_t wait_us);           /* 1 and a byte of the line; 0 if none has come in time */
void port_write(const uint8_t *bytes, uint32_t count);    /* may wait until the line takes them; receives meanwhile */
uint32_t port_time(void);                                 /* [us], modulo 2^32 */
uint32_t port_cycles(void);                               /* a counter that runs on, modulo 2^32 */
void port_reset(int why);                                 /* starts the board again, or ends it; does not come back */

#endif
