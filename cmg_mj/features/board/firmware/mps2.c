/* The board that QEMU calls mps2-an500: ARM's MPS2 with a Cortex-M7. Its UART and timers are those of ARM's
 * CMSDK (Cortex-M System Design Kit). The emulated line has no baud rate. */
#include "port.h"

#define WORD(address) (*(volatile uint32_t *)(address))

#define TIMER_CONTROL WORD(0x40000000u)
#define TIMER_VALUE WORD(0x40000004u)
#define TIMER_RELOAD WORD(0x40000008u)
#define WATCH_CONTROL WORD(0x40001000u) /* the second timer */
#define WATCH_VALUE WORD(0x40001004u)
#define WATCH_RELOAD WORD(0x40001008u)
#define WATCH_STATUS WORD(0x4000100cu)
#define UART_DATA WORD(0x40004000u)
#define UART_STATE WORD(0x40004004u) /* bit 0: cannot send yet; bit 1: a byte has come */
#define UART_CONTROL WORD(0x40004008u)
#define UART_STATUS WORD(0x4000400cu)
#define UART_DIVIDER WORD(0x40004010u)
#define INTERRUPTS WORD(0xe000e100u)
#define PENDING_NO_MORE WORD(0xe000e280u)

enum { UART_RECEIVED = 1u << 0, WATCH = 1u << 9 }; /* numbers of the interrupts */

void port_init(void)
{
    UART_DIVIDER = 16;
    UART_CONTROL = 0xb; /* send, receive, interrupt when something has come */
    (void)UART_DATA;    /* QEMU looks for something to receive when the last byte has been taken, and not when we begin */
    TIMER_RELOAD = TIMER_VALUE = 0xffffffffu;
    TIMER_CONTROL = 1;
    __asm volatile("cpsid i" ::: "memory"); /* interrupts only end a wait: nothing comes between two instructions */
    INTERRUPTS = UART_RECEIVED | WATCH;
}

uint8_t port_read(void)
{
    WATCH_CONTROL = 0;
    WATCH_RELOAD = WATCH_VALUE = 0xffffffffu; /* 172 s at 25 MHz */
    WATCH_CONTROL = 0x9; /* count, interrupt */
    for (;;) {
        uint32_t over;

        /* In this order: what comes after the interrupt was taken back raises it again, what came before is seen. */
        UART_STATUS = 0x2;
        over = WATCH_STATUS & 1u;
        WATCH_STATUS = 1;
        PENDING_NO_MORE = UART_RECEIVED | WATCH;
        if (UART_STATE & 2u)
            return (uint8_t)UART_DATA;
        if (over)
            port_reset(NOBODY_TALKS);
        __asm volatile("wfi" ::: "memory");
    }
}

/* The emulated line loses nothing: a byte is not sent to the board before the last one has been taken. */
void port_write(const uint8_t *bytes, uint32_t count)
{
    while (count--) {
        while (UART_STATE & 1u) {
        }
        UART_DATA = *bytes++;
    }
}

uint32_t port_cycles(void)
{
    return ~TIMER_VALUE; /* it counts down */
}

void port_reset(int why)
{
    /* Ends the emulator. Semihosting: SYS_EXIT_EXTENDED, ADP_Stopped_ApplicationExit with a status. */
    const uint32_t block[2] = {0x20026u, (uint32_t)why};
    register uint32_t operation __asm("r0") = 0x20;
    register const void *parameter __asm("r1") = block;
    __asm volatile("bkpt 0xab" ::"r"(operation), "r"(parameter) : "memory");
    for (;;) {
    }
}
