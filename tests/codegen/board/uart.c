/* The registers of the STM32F746 that its port layer touches, for the computer that runs the test: time goes on with every
 * look at them. The USART is the chip's: one byte waits to be read, one to be sent, and an overrun loses the newer one.
 *
 * Standard input: to run until a time [ns], and what comes meanwhile: uint64, uint32 count, count times (uint64, uint8).
 * Standard output, when that time has come: how often a byte was lost in an overrun and PLLCFGR, 2 uint32; how many bytes
 * went out, uint32; and these, with the time [ns] at which each was gone: (uint64, uint8). */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LOOK_NS = 60, MOST = 1 << 16 };
enum { TIM2_CNT = 0x40000024, PWR_CSR1 = 0x40007004, BRR = 0x4001100c, ISR = 0x4001101c, ICR = 0x40011020 };
enum { RDR = 0x40011024, TDR = 0x40011028, RCC_CR = 0x40023800, PLLCFGR = 0x40023804, CFGR = 0x40023808 };
#define AIRCR 0xe000ed0cu

struct passing {
    uint64_t time;
    uint8_t byte;
};

uint32_t stack_bottom[1] = {0x5aa5c33c};

static struct passing up[MOST], down[MOST];
static uint32_t up_count, up_at, down_count, overruns;
static uint64_t now, until, shifted; /* when the byte that is going out is gone */
static uint32_t isr = 0x80, rdr, waiting = ~0u, tdr = ~0u, icr, brr, pllcfgr = 0x24003010, cfgr, other;

static void get(void *to, size_t bytes)
{
    if (fread(to, 1, bytes, stdin) != bytes)
        exit(0);
}

static void put(const void *from, size_t bytes)
{
    fwrite(from, 1, bytes, stdout);
}

static void report_and_wait(void)
{
    uint32_t i;

    put(&overruns, 4);
    put(&pllcfgr, 4);
    put(&down_count, 4);
    for (i = 0; i < down_count; i++) {
        put(&down[i].time, 8);
        put(&down[i].byte, 1);
    }
    fflush(stdout);
    down_count = 0;
    memmove(up, up + up_at, (up_count - up_at) * sizeof *up);
    up_count -= up_at;
    up_at = 0;
    get(&until, 8);
    get(&i, 4);
    while (i--) {
        get(&up[up_count].time, 8);
        get(&up[up_count++].byte, 1);
    }
}

static void send(void)
{
    if (tdr != ~0u) { /* it has been written since the last look */
        waiting = tdr & 0xffu;
        tdr = ~0u;
    }
    if (waiting != ~0u && shifted <= now) {
        shifted = now + 10ull * 1000 * brr / 108;
        down[down_count].time = shifted;
        down[down_count++].byte = (uint8_t)waiting;
        waiting = ~0u;
    }
    isr = waiting == ~0u ? isr | 0x80u : isr & ~0x80u;
}

static void receive(void)
{
    isr &= ~(icr & 0xfu);
    icr = 0;
    for (; up_at < up_count && up[up_at].time <= now; up_at++) {
        if (isr & 0x20u) {
            overruns++;
            isr |= 0x8u;
        } else if (!(isr & 0x8u)) { /* not before the overrun has been cleared */
            rdr = up[up_at].byte;
            isr |= 0x20u;
        }
    }
}

void pass(uint64_t ns)
{
    const uint64_t then = now + ns;

    while (now < then) {
        while (now >= until)
            report_and_wait();
        now = then < until ? then : until;
        send();
        receive();
    }
}

volatile uint32_t *look_at(uint32_t place)
{
    static uint32_t time;

    pass(LOOK_NS);
    switch (place) {
    case ISR:
        /* Nothing to do: on to what comes next, or to where the time of a wait may be over. */
        if (!(isr & 0x2fu) && waiting == ~0u && tdr == ~0u) {
            uint64_t next = now + 10000;

            next = up_at < up_count && up[up_at].time < next ? up[up_at].time : next;
            if (next > now)
                pass(next - now);
        }
        return &isr;
    case RDR:
        isr &= ~0x20u;
        return &rdr;
    case TDR:
        return &tdr;
    case ICR:
        return &icr;
    case BRR:
        return &brr;
    case TIM2_CNT:
        time = (uint32_t)(now / 1000);
        return &time;
    case PLLCFGR:
        return &pllcfgr;
    case CFGR:
        cfgr = (cfgr & ~0xcu) | (cfgr & 3u) << 2;
        return &cfgr;
    case RCC_CR:
    case PWR_CSR1:
        other = ~0u;
        return &other;
    case AIRCR:
        exit(3);
    case 0x40023c00:
        other = 7;
        return &other;
    default:
        other = 0;
        return &other;
    }
}
