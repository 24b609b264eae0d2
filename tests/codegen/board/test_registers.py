"""The registers of the STM32F746's port layer: their addresses, and what they hold once the board has begun."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from cmg_mj.codegen.board.image import FIRMWARE
from cmg_mj.codegen.board.ports import BAUD
from tests.codegen.board.toy import needs_board
from tests.codegen.board.uart import NATIVE

SOURCES = {
    # CMSIS Device F7 1.2.9, stm32f746xx.h: base + offset in the peripheral's structure
    "TIM2_CR1": 0x40000000,
    "TIM2_CNT": 0x40000024,
    "TIM2_PSC": 0x40000028,
    "TIM2_ARR": 0x4000002C,
    "TIM2_EGR": 0x40000014,
    "PWR_CR1": 0x40007000,
    "PWR_CSR1": 0x40007004,
    "USART1_CR1": 0x40011000,
    "USART1_BRR": 0x4001100C,
    "USART1_ISR": 0x4001101C,
    "USART1_ICR": 0x40011020,
    "USART1_RDR": 0x40011024,
    "USART1_TDR": 0x40011028,
    "RCC_CR": 0x40023800,
    "RCC_PLLCFGR": 0x40023804,
    "RCC_CFGR": 0x40023808,
    "RCC_AHB1ENR": 0x40023830,
    "RCC_APB1ENR": 0x40023840,
    "RCC_APB2ENR": 0x40023844,
    "FLASH_ACR": 0x40023C00,
    "GPIO_MODER(GPIOA)": 0x40020000,
    "GPIO_MODER(GPIOB)": 0x40020400,
    "GPIO_AFRH(GPIOA)": 0x40020024,
    "GPIO_AFRL(GPIOB)": 0x40020420,
    "GPIO_PUPDR(GPIOB)": 0x4002040C,
    # CMSIS Core, core_cm7.h: SCB 0xE000ED00, DWT 0xE0001000, CoreDebug 0xE000EDF0
    "SCB_VTOR": 0xE000ED08,
    "SCB_AIRCR": 0xE000ED0C,
    "SCB_CCR": 0xE000ED14,
    "SCB_CCSIDR": 0xE000ED80,
    "SCB_CSSELR": 0xE000ED84,
    "SCB_ICIALLU": 0xE000EF50,
    "SCB_DCISW": 0xE000EF60,
    "DEMCR": 0xE000EDFC,
    "DWT_CTRL": 0xE0001000,
    "DWT_CYCCNT": 0xE0001004,
    "DWT_LAR": 0xE0001FB0,
}
"""Register of stm32f746.c -> its address, written down from the sources a second time."""


RESETS = {
    # RM0385: value after a reset, where it is not 0
    "RCC_CR": 0x83,
    "RCC_PLLCFGR": 0x24003010,
    "RCC_AHB1ENR": 0x00100000,
    "PWR_CR1": 0xC000,
    "GPIO_MODER(GPIOA)": 0xA8000000,
    "GPIO_MODER(GPIOB)": 0x280,
    "GPIO_PUPDR(GPIOB)": 0x100,
    # ARM's Cortex-M7 TRM and ST's PM0253; 4 kB of data cache: 32 sets, 4 ways
    "SCB_CCR": 0x00040200,
    "SCB_CCSIDR": 0xF003E019,
    "DWT_CTRL": 0x40000000,
    # not of the chip: so that a 0 written there is seen
    "SCB_ICIALLU": 1,
    "DWT_CYCCNT": 1,
    # a byte has come behind one that was lost, and one may be sent
    "USART1_ISR": 1 << 7 | 1 << 5 | 1 << 3,
    "USART1_RDR": ord("r"),
}
"""Register -> what it holds before."""

VALUES = {
    # CMSIS Device F7 1.2.9, stm32f746xx.h: positions of the bits by their names
    "RCC_CR": 0x83 | 1 << 16 | 1 << 17 | 1 << 24 | 1 << 25,  # HSEON, HSERDY, PLLON, PLLRDY
    "RCC_PLLCFGR": 25 | 432 << 6 | 0 << 16 | 1 << 22 | 9 << 24 | 1 << 29,  # M, N, P, PLLSRC, Q; 29 is reserved
    "RCC_CFGR": 0b10 | 0b10 << 2 | 0b101 << 10 | 0b100 << 13,  # SW, SWS, PPRE1, PPRE2
    "RCC_AHB1ENR": 0x00100000 | 1 << 0 | 1 << 1,  # GPIOAEN, GPIOBEN
    "RCC_APB1ENR": 1 << 0 | 1 << 28,  # TIM2EN, PWREN
    "RCC_APB2ENR": 1 << 4,  # USART1EN
    "PWR_CR1": 0xC000 | 1 << 16 | 1 << 17,  # ODEN, ODSWEN
    "PWR_CSR1": 1 << 16 | 1 << 17,  # ODRDY, ODSWRDY
    "FLASH_ACR": 7 | 1 << 8 | 1 << 9,  # LATENCY, PRFTEN, ARTEN
    "GPIO_MODER(GPIOA)": 0xA8000000 | 0b10 << 2 * 9,  # PA9: alternate function
    "GPIO_AFRH(GPIOA)": 7 << 4 * (9 - 8),
    "GPIO_MODER(GPIOB)": 0x280 | 0b10 << 2 * 7,  # PB7: alternate function, pulled up
    "GPIO_AFRL(GPIOB)": 7 << 4 * 7,
    "GPIO_PUPDR(GPIOB)": 0x100 | 0b01 << 2 * 7,
    "USART1_BRR": round(108e6 / BAUD),
    "USART1_CR1": 1 << 0 | 1 << 2 | 1 << 3,  # UE, RE, TE
    "USART1_ICR": 1 << 0 | 1 << 1 | 1 << 2 | 1 << 3,  # PECF, FECF, NCF, ORECF
    "USART1_TDR": ord("t"),
    "TIM2_PSC": 108 - 1,  # 1 MHz
    "TIM2_ARR": 0xFFFFFFFF,
    "TIM2_EGR": 1 << 0,  # UG
    "TIM2_CR1": 1 << 0,  # CEN
    # CMSIS Core, core_cm7.h
    "SCB_VTOR": 0x08000000,
    "SCB_CCR": 0x00040200 | 1 << 16 | 1 << 17,  # DC, IC
    "SCB_ICIALLU": 0,
    "SCB_DCISW": 31 << 5 | 3 << 30,  # SET, WAY: the last ones
    "SCB_AIRCR": 0x5FA << 16 | 1 << 2,  # VECTKEY, SYSRESETREQ
    "DEMCR": 1 << 24,  # TRCENA
    "DWT_LAR": 0xC5ACCE55,
    "DWT_CYCCNT": 0,
    "DWT_CTRL": 0x40000000 | 1 << 0,  # CYCCNTENA
}
"""Register -> what it holds at the end; any other holds what it held before."""

CLOCK = ["RCC_CR", "RCC_PLLCFGR", "RCC_CR", "PWR_CR1", "PWR_CR1", "FLASH_ACR", "RCC_CFGR"]
"""The order in which the clock is raised: over-drive and wait states before the PLL is taken (RM0385)."""


def defined(source: str) -> list[str]:
    """Names of the registers that a port layer defines."""
    return sorted(re.findall(r"^#define (\w+)(?:\(port\))? WORD\(", source, re.MULTILINE))


@needs_board
def test_registers_are_where_the_sources_have_them(tmp_path: Path) -> None:
    """The compiler works the addresses out; a wrong one does not compile."""
    source = (FIRMWARE / "stm32f746.c").read_text()
    assert defined(source) == sorted({name.partition("(")[0] for name in SOURCES})
    test = tmp_path / "addresses.c"
    command = ["arm-none-eabi-gcc", "-mcpu=cortex-m7", "-fsyntax-only", "-DBAUD=460800u", "-I", FIRMWARE, test]
    for off in (0, 4):
        checks = [
            f'_Static_assert((uint32_t)&({name}) == {place + off:#x}u, "{name}");' for name, place in SOURCES.items()
        ]
        test.write_text(source + "\n".join(checks))
        process = subprocess.run(command, capture_output=True, text=True, check=False)
        wrong = re.findall(r'static assertion failed: "(.*)"', process.stderr)
        assert wrong == (list(SOURCES) if off else []), process.stderr


HARNESS = """
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include "port.h"

static struct { uint32_t place, value, before; int used; } words[] = {%s};
enum { COUNT = sizeof words / sizeof *words };
static jmp_buf on_reset;

static uint32_t *at(uint32_t place)
{
    int i;

    for (i = 0; i < COUNT; i++)
        if (words[i].place == place) {
            words[i].used = 1;
            return &words[i].value;
        }
    printf("unknown %%x 0\\n", (unsigned)place);
    return &words[0].value;
}

static void changes(void)
{
    int i;

    *at(0x40023800u) |= (*at(0x40023800u) & (1u << 16 | 1u << 24)) << 1;
    *at(0x40007004u) = *at(0x40007000u) & 3u << 16;
    for (i = 0; i < COUNT; i++)
        if (words[i].value != words[i].before) {
            printf("changed %%x %%x\\n", (unsigned)words[i].place, (unsigned)words[i].value);
            words[i].before = words[i].value;
        }
    *at(0x40023808u) = (*at(0x40023808u) & ~0xcu) | (*at(0x40023808u) & 3u) << 2;
}

void barrier(void)
{
    changes();
    if (*at(0xe000ed0cu))
        longjmp(on_reset, 1);
}

volatile uint32_t *look_at(uint32_t place)
{
    changes();
    return at(place);
}

int main(void)
{
    uint8_t byte = 't';
    int i;

    printf("begun %%d 0\\n", port_init());
    (void)port_time();
    (void)port_cycles();
    port_write(&byte, 1);
    port_read(&byte, 0);
    printf("byte %%x 0\\n", byte);
    if (!setjmp(on_reset))
        port_reset(101);
    for (i = 0; i < COUNT; i++)
        printf("%%s %%x %%x\\n", words[i].used ? "value" : "unused", (unsigned)words[i].place,
               (unsigned)words[i].value);
    *at(0xe000ed0cu) = 0;
    printf("begun %%d 0\\n", port_init());
    return 0;
}
"""
"""A memory for the registers: the oscillator, the PLL, over-drive and the clock's switch are ready at once."""


def lines_of(folder: Path, change: tuple[str, str] = ("", "")) -> list[list[str]]:
    """Run the port layer on this computer; return the lines of `HARNESS`, with names in the places of addresses."""
    source = (FIRMWARE / "stm32f746.c").read_text()
    for old, new in {**NATIVE["stm32f746.c"], "(void)0": "barrier()", change[0]: change[1]}.items():
        source = source.replace(old, new) if old else source
    (folder / "port.c").write_text("void barrier(void);\n" + source)
    words = [f"{{{place:#x}u, {RESETS.get(name, 0)}u, {RESETS.get(name, 0)}u, 0}}" for name, place in SOURCES.items()]
    (folder / "main.c").write_text(HARNESS % ", ".join(words))
    program = folder / "registers"
    sources = [folder / "port.c", folder / "main.c"]
    subprocess.run(["cc", f"-DBAUD={BAUD}u", "-I", FIRMWARE, *sources, "-o", program], check=True)
    printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    names = {f"{place:x}": name for name, place in SOURCES.items()}
    return [[kind, names.get(place, place), value] for kind, place, value in map(str.split, printed.splitlines())]


def values(lines: list[list[str]]) -> dict[str, int]:
    return {name: int(value, 16) for kind, name, value in lines if kind in ("value", "unused")}


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_registers_hold_what_the_sources_say(tmp_path: Path) -> None:
    """Each register is used, and holds after the start what the bits' names say; the clock is raised in order."""
    lines = lines_of(tmp_path)
    assert [line for line in lines if line[0] in ("unknown", "unused")] == []
    assert values(lines) == {name: VALUES.get(name, RESETS.get(name, 0)) for name in SOURCES}
    changed = [name for kind, name, _ in lines if kind == "changed" and name in CLOCK]
    assert changed[: len(CLOCK)] == CLOCK
    assert [name for kind, name, _ in lines if kind == "begun"] == ["0", "101"]
    assert ["byte", f"{ord('r'):x}", "0"] in lines


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
@pytest.mark.parametrize(
    ("old", "new", "register"),
    [
        ("432u << 6", "431u << 6", "RCC_PLLCFGR"),
        ("| KEEP_PLL_RESERVED", "", "RCC_PLLCFGR"),
        ("PWR_CR1 |= OVERDRIVE_ON", "PWR_CR1 = OVERDRIVE_ON", "PWR_CR1"),
        ("7u | ART_AND_PREFETCH", "6u + 1u", "FLASH_ACR"),
        ("LINE_ERRORS (0xfu)", "LINE_ERRORS (0x8u)", "USART1_ICR"),
        ("TIM2_CR1 = 1;", "", "TIM2_CR1"),
        ("2u << 18", "1u << 18", "GPIO_MODER(GPIOA)"),
        ("0x05fa0004u", "0x05fa0001u", "SCB_AIRCR"),
    ],
    ids=["pll", "reserved", "over-drive", "flash", "errors", "timer", "pin", "reset"],
)
def test_a_wrong_value_would_be_seen(tmp_path: Path, old: str, new: str, register: str) -> None:
    right, wrong = values(lines_of(tmp_path)), values(lines_of(tmp_path, (old, new)))
    assert [name for name in right if right[name] != wrong[name]] == [register]
