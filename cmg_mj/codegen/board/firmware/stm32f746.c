/* The port layer of ST's 32F746GDISCOVERY: STM32F746NG, a Cortex-M7 at 216 MHz, both caches on. The line is USART1, which the
 * ST-LINK on the board shows to the host as a serial port.
 *
 * This file compiles. It has never run on the chip.
 *
 * Sources of addresses, offsets and bits:
 *   [H] ST's stm32f746xx.h of CMSIS Device F7 1.2.9 (github.com/STMicroelectronics/cmsis_device_f7)
 *   [C] ARM's core_cm7.h of CMSIS Core
 *   [T] ST's template for this board, SystemClock_Config: 25 MHz oscillator, M 25, N 432, P 2, Q 9, over-drive, 7 wait
 *       states, APB1 a quarter, APB2 a half (github.com/STMicroelectronics/STM32CubeF7, Projects/STM32746G-Discovery)
 *   [B] ST's stm32746g_discovery.h: COM1 is USART1, sent on PA9, received on PB7, alternate function 7
 *   [R] ST's reference manual RM0385: the order of over-drive and wait states, before the clock is raised */
#include "port.h"

#define WORD(address) (*(volatile uint32_t *)(address))

/* [H] */
enum {
    TIM2 = 0x40000000,
    PWR = 0x40007000,
    USART1 = 0x40011000,
    GPIOA = 0x40020000,
    GPIOB = 0x40020400,
    RCC = 0x40023800,
    FLASH = 0x40023c00
};
#define TIM2_CR1 WORD(TIM2 + 0x00)
#define TIM2_EGR WORD(TIM2 + 0x14)
#define TIM2_CNT WORD(TIM2 + 0x24)
#define TIM2_PSC WORD(TIM2 + 0x28)
#define TIM2_ARR WORD(TIM2 + 0x2c)
#define PWR_CR1 WORD(PWR + 0x00)
#define PWR_CSR1 WORD(PWR + 0x04)
#define USART1_CR1 WORD(USART1 + 0x00)
#define USART1_BRR WORD(USART1 + 0x0c)
#define USART1_ISR WORD(USART1 + 0x1c)
#define USART1_ICR WORD(USART1 + 0x20)
#define USART1_RDR WORD(USART1 + 0x24)
#define USART1_TDR WORD(USART1 + 0x28)
#define GPIO_MODER(port) WORD((port) + 0x00)
#define GPIO_PUPDR(port) WORD((port) + 0x0c)
#define GPIO_AFRL(port) WORD((port) + 0x20)
#define GPIO_AFRH(port) WORD((port) + 0x24)
#define RCC_CR WORD(RCC + 0x00)
#define RCC_PLLCFGR WORD(RCC + 0x04)
#define RCC_CFGR WORD(RCC + 0x08)
#define RCC_AHB1ENR WORD(RCC + 0x30)
#define RCC_APB1ENR WORD(RCC + 0x40)
#define RCC_APB2ENR WORD(RCC + 0x44)
#define FLASH_ACR WORD(FLASH + 0x00)

/* [C] */
#define SCB_VTOR WORD(0xe000ed08u)
#define SCB_AIRCR WORD(0xe000ed0cu)
#define SCB_CCR WORD(0xe000ed14u)
#define SCB_CCSIDR WORD(0xe000ed80u)
#define SCB_CSSELR WORD(0xe000ed84u)
#define SCB_ICIALLU WORD(0xe000ef50u)
#define SCB_DCISW WORD(0xe000ef60u)
#define DEMCR WORD(0xe000edfcu)
#define DWT_CTRL WORD(0xe0001000u)
#define DWT_CYCCNT WORD(0xe0001004u)
#define DWT_LAR WORD(0xe0001fb0u)

/* [H] */
#define HSE_ON (1u << 16)
#define HSE_READY (1u << 17)
#define PLL_ON (1u << 24)
#define PLL_READY (1u << 25)
#define PLL_FROM_HSE (1u << 22)
#define OVERDRIVE_ON (1u << 16)
#define OVERDRIVE_SWITCH (1u << 17)
#define OVERDRIVE_READY (1u << 16)
#define OVERDRIVE_SWITCHED (1u << 17)
#define ART_AND_PREFETCH (3u << 8)
#define SENDS_RECEIVES_IS_ON (1u << 3 | 1u << 2 | 1u << 0)
#define LINE_ERRORS (0xfu) /* overrun, noise, frame, parity: the same bits in ISR and ICR */
#define BYTE_HAS_COME (1u << 5)
#define MAY_SEND (1u << 7)

#define KEEP_PLL_RESERVED (1u << 29) /* [R]: to be kept as a reset leaves it, and a reset leaves 0x24003010 */

enum { CLOCK_MHZ = 216, TIMER_MHZ = 108 }; /* APB1's timers run at twice APB1's clock */

#define LINE_HZ 108000000u /* APB2's clock */
#define LINE_DIVIDER ((LINE_HZ + BAUD / 2u) / BAUD)
#if LINE_DIVIDER < 16u || LINE_DIVIDER > 65535u /* [R] */
#error "BAUD: USART1 can do 1648 to 6750000"
#endif

const char port_name[] = "STM32F746G-DISCO";
const uint32_t port_cycles_a_second = CLOCK_MHZ * 1000000u;

static struct {
    uint32_t magic;
    int why;
} note __attribute__((section(".noinit"))); /* a reset leaves it as it is */

enum { NOTED = 0x6e6f7465 };

#define BARRIER() __asm volatile("dsb\n\tisb" ::: "memory")

static void clock_up(void) /* [T], [R] */
{
    RCC_CR |= HSE_ON;
    while (!(RCC_CR & HSE_READY)) {
    }
    RCC_APB1ENR |= 1u << 28; /* power control */
    (void)RCC_APB1ENR;
    RCC_PLLCFGR = 25u | 432u << 6 | 0u << 16 /* halved */ | PLL_FROM_HSE | 9u << 24 | KEEP_PLL_RESERVED;
    RCC_CR |= PLL_ON;
    PWR_CR1 |= OVERDRIVE_ON; /* the voltage scale is 1 after a reset */
    while (!(PWR_CSR1 & OVERDRIVE_READY)) {
    }
    PWR_CR1 |= OVERDRIVE_SWITCH;
    while (!(PWR_CSR1 & OVERDRIVE_SWITCHED)) {
    }
    FLASH_ACR = 7u | ART_AND_PREFETCH;
    while ((FLASH_ACR & 0xfu) != 7u) {
    }
    while (!(RCC_CR & PLL_READY)) {
    }
    RCC_CFGR = 0x1400u /* APB1: a quarter */ | 0x8000u /* APB2: a half */ | 2u /* from the PLL */;
    while ((RCC_CFGR & 0xcu) != 8u) {
    }
}

static void caches_on(void) /* as [C] does it */
{
    uint32_t sets, ways, set, way;

    BARRIER();
    SCB_ICIALLU = 0;
    BARRIER();
    SCB_CCR |= 1u << 17;
    SCB_CSSELR = 0;
    BARRIER();
    sets = SCB_CCSIDR >> 13 & 0x7fffu;
    ways = SCB_CCSIDR >> 3 & 0x3ffu;
    for (set = 0; set <= sets; set++)
        for (way = 0; way <= ways; way++)
            SCB_DCISW = set << 5 | way << 30;
    BARRIER();
    SCB_CCR |= 1u << 16;
    BARRIER();
}

static void line_on(void) /* [B] */
{
    RCC_AHB1ENR |= 3u; /* ports A and B */
    RCC_APB2ENR |= 1u << 4;
    (void)RCC_APB2ENR;
    GPIO_AFRH(GPIOA) = (GPIO_AFRH(GPIOA) & ~(0xfu << 4)) | 7u << 4; /* PA9 */
    GPIO_MODER(GPIOA) = (GPIO_MODER(GPIOA) & ~(3u << 18)) | 2u << 18;
    GPIO_AFRL(GPIOB) = (GPIO_AFRL(GPIOB) & ~(0xfu << 28)) | 7u << 28; /* PB7, pulled up: a line that nobody drives is idle */
    GPIO_PUPDR(GPIOB) = (GPIO_PUPDR(GPIOB) & ~(3u << 14)) | 1u << 14;
    GPIO_MODER(GPIOB) = (GPIO_MODER(GPIOB) & ~(3u << 14)) | 2u << 14;
    USART1_BRR = LINE_DIVIDER;
    USART1_CR1 = SENDS_RECEIVES_IS_ON; /* 8 bits, no parity, one stop bit */
}

static void counters_on(void)
{
    RCC_APB1ENR |= 1u; /* TIM2, of 32 bits */
    (void)RCC_APB1ENR;
    TIM2_PSC = TIMER_MHZ - 1u;
    TIM2_ARR = 0xffffffffu;
    TIM2_EGR = 1; /* takes the prescaler over */
    TIM2_CR1 = 1;
    DEMCR |= 1u << 24; /* trace on, or the cycle counter stands still */
    DWT_LAR = 0xc5acce55u;
    DWT_CYCCNT = 0;
    DWT_CTRL |= 1u;
}

int port_init(void)
{
    const int why = note.magic == NOTED ? note.why : 0;

    note.magic = 0;
    SCB_VTOR = 0x08000000u; /* [H]: the flash; the vectors stand first in it */
    clock_up();
    caches_on();
    line_on();
    counters_on();
    return why;
}

/* What has come and nobody has read: the USART itself has room for one byte, and a message may come while another goes. */
enum { ROOM = 512 };
static uint8_t ring[ROOM];
static uint32_t came, went; /* bytes; the ring's places are these modulo ROOM */

static void receive(void)
{
    const uint32_t state = USART1_ISR;

    if (state & LINE_ERRORS)
        USART1_ICR = LINE_ERRORS; /* an overrun would stop the line; the lost byte shows in a frame's check */
    if (state & BYTE_HAS_COME) {
        const uint8_t byte = (uint8_t)USART1_RDR;

        if (came - went < ROOM)
            ring[came++ % ROOM] = byte;
    }
}

int port_read(uint8_t *byte, uint32_t wait_us)
{
    const uint32_t start = port_time();

    do {
        receive();
        if (came != went) {
            *byte = ring[went++ % ROOM];
            return 1;
        }
    } while (port_time() - start < wait_us);
    return 0;
}

void port_write(const uint8_t *bytes, uint32_t count)
{
    while (count--) {
        do
            receive();
        while (!(USART1_ISR & MAY_SEND));
        USART1_TDR = *bytes++;
    }
}

uint32_t port_time(void)
{
    return TIM2_CNT;
}

uint32_t port_cycles(void)
{
    return DWT_CYCCNT;
}

void port_reset(int why)
{
    note.magic = NOTED;
    note.why = why;
    BARRIER();
    SCB_AIRCR = 0x05fa0004u; /* the key, and the request for a reset */
    BARRIER();
    for (;;) {
    }
}
