/* What the firmware needs of a machine. mps2.c has it for QEMU's mps2-an500; a real board brings its own. */
#ifndef MACHINE_H
#define MACHINE_H

#include <stdint.h>

void machine_start(void);          /* once, before the rest */
uint8_t machine_receive(void);     /* waits for a byte of the serial line */
void machine_send(uint8_t byte);   /* may wait until the line takes it */
uint32_t machine_time(void);       /* a counter that runs on, modulo 2^32 */
void machine_halt(int status);     /* does not come back */

enum { NOBODY_TALKS = 0, FAULT = 101, STACK_FULL = 102 }; /* why it halts */

#endif
