/* The board that QEMU calls mps2-an500, as board.c uses it: see mps2.c. */
#ifndef PORT_H
#define PORT_H

#include <stdint.h>

/* Exit status of the emulator: why the board has ended. */
enum { NOBODY_TALKS = 0, FAULT = 101, STACK_FULL = 102 };

void port_init(void);                                  /* once, before the rest: line and timers */
uint8_t port_read(void);                               /* waits for a byte; ends the board after three minutes without one */
void port_write(const uint8_t *bytes, uint32_t count);
uint32_t port_cycles(void);                            /* a counter that runs on, modulo 2^32 */
void port_reset(int why);                              /* ends the board; does not come back */

#endif
