"""Writes the firmware with a controller as a project that one can build and flash."""

from __future__ import annotations

from cmg_mj.codegen.board.identity import identity_of
from cmg_mj.codegen.board.image import FIRMWARE, FLAGS, MACHINES, macros_of
from cmg_mj.codegen.board.ports import BAUD
from cmg_mj.codegen.board.tools import COMPILER, EMULATOR
from cmg_mj.core.controller import Controller

EMULATED_PORT = 5555
"""TCP port of the emulated board that `make emulate` starts."""
STRICT = ("-Werror", "-Wl,--fatal-warnings")
"""Flags that are not for a user's own compiler."""
NEVER_RUN = ("stm32f746",)
"""Machines whose firmware compiles and has never run on the chip."""
HOW_TO_RUN = {
    "mps2": f"""emulate: $(NAME).elf
\t{EMULATOR} -M mps2-an500 -nodefaults -nographic -monitor none -semihosting-config enable=on,target=native \\
\t  -serial tcp:localhost:$(PORT),server=on,nodelay=on -kernel $<
""",
    "stm32f746": """flash: $(NAME).elf
\topenocd -f board/stm32f746g-disco.cfg -c "program $< verify reset exit"
""",
}
"""Machine -> the Makefile's rule that brings the firmware to run."""
PORTS = {"mps2": f"tcp:localhost:{EMULATED_PORT}", "stm32f746": "/dev/ttyACM0"}
"""Machine -> the port on which the firmware answers."""


def then(machine: str, make: str, run_it: str) -> str:
    """Say how to bring the firmware to run, and what to do then.

    Args:
        machine: The board, one of `MACHINES`.
        make: The command that makes a target of the project, up to the target.
        run_it: The command that runs the scenario on the board.
    """
    if machine == "mps2":
        return f"Then, in a terminal of its own, which it keeps busy: {make}emulate\nAnd in this one: {run_it}"
    return f"Then: {make}flash && {run_it}"


def project_files(machine: str) -> list[str]:
    """Name the files of a project beside those of the export."""
    board = MACHINES[machine]
    return ["board.c", "its.h", "port.h", "startup.c", board.sources, board.script, "Makefile"]


def project(controller: Controller, name: str, code: str, machine: str, run_it: str) -> dict[str, str]:
    """Write the files of a project beside those of the export.

    Args:
        controller: The exported controller.
        name: The observer's name in C.
        code: Text of its .c file, in single precision.
        machine: The board, one of `MACHINES`.
        run_it: The command that runs the scenario on the board.

    Returns:
        Name -> text.
    """
    *sources, _ = project_files(machine)
    files = {file: (FIRMWARE / file).read_text(encoding="utf-8") for file in sources}
    return {**files, "Makefile": _makefile(name, machine, identity_of(controller, name, code).text(), run_it)}


def _makefile(name: str, machine: str, identity: str, run_it: str) -> str:
    board = MACHINES[machine]
    flags = " ".join(flag for flag in FLAGS if flag not in STRICT)
    macros = " ".join(f"'-D{macro}'" for macro in macros_of(name, machine, identity))
    sources = f"startup.c {board.sources} board.c {name}.c"
    how = "\n".join(f"# {line}" for line in then(machine, "make ", " ".join(run_it.split())).splitlines())
    warning = "# The firmware compiles. It has never run on this chip.\n" if machine in NEVER_RUN else ""
    return f"""# {name} on {board.title}; written by cmg_mj, whose docs/board.md says more.
{how}
{warning}
NAME := {name}
BAUD ?= {BAUD}
PORT ?= {EMULATED_PORT}
CC := {COMPILER}
FLAGS := {flags}
MACROS := {macros} -DBAUD=$(BAUD)u

all: $(NAME).elf $(NAME).bin

$(NAME).elf: {sources} {name}.h its.h port.h {board.script} Makefile $(NAME).baud
\t$(CC) $(FLAGS) $(MACROS) -I. -T {board.script} {sources} -lm -o $@

# The rate of the last build, written where it changes.
$(NAME).baud: always
\t@test "$$(cat $@ 2>/dev/null)" = "$(BAUD)" || echo "$(BAUD)" > $@

$(NAME).bin: $(NAME).elf
\t{COMPILER.replace("gcc", "objcopy")} -O binary $< $@

{HOW_TO_RUN[machine]}
clean:
\trm -f $(NAME).elf $(NAME).bin $(NAME).baud

.PHONY: all always clean emulate flash
"""
