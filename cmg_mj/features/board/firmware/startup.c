/* From reset to main on a Cortex-M with a floating-point unit: memory as C expects it, and the unit switched on. */
#include <stdint.h>

#include "port.h"

extern uint32_t image_data[], data_start[], data_end[], bss_start[], bss_end[], stack_top[];

int main(void);
void reset(void);

static void fault(void)
{
    port_reset(FAULT);
}

void reset(void)
{
    const uint32_t *from = image_data;
    uint32_t *to;

    *(volatile uint32_t *)0xe000ed88u |= 0xfu << 20; /* CPACR: coprocessors 10 and 11 are the floating-point unit */
    __asm volatile("dsb\n\tisb" ::: "memory");
    for (to = data_start; to < data_end;)
        *to++ = *from++;
    for (to = bss_start; to < bss_end;)
        *to++ = 0;
    main();
    port_reset(NOBODY_TALKS);
}

/* Where the stack begins, where to begin, then what to do in NMI, HardFault and the other faults. No interrupt is served. */
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*handlers[15])(void);
} vectors = {stack_top, {reset, fault, fault, fault, fault, fault}};
