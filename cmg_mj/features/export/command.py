"""The command that exports an observer as C for a board."""

from __future__ import annotations

from typing import Literal

import click

from cmg_mj.cli.arguments import RunArguments, claim_output, export_options, json_option, out_option
from cmg_mj.cli.terminal import note, note_hints, say_written, shell_command, show, users_code


@click.command()
@out_option()
@click.option(
    "--precision",
    type=click.Choice(["double", "single"]),
    default="double",
    show_default=True,
    help="Precision of all numbers in the C code.",
)
@click.option("--name", metavar="NAME", help="Prefix of files, types and functions.  [default: OBSERVER's name]")
@export_options
@json_option()
@users_code()
def export(
    observer: str,
    out: str | None,
    precision: Literal["double", "single"],
    name: str | None,
    scenario: str,
    settings: tuple[str, ...],
    as_json: bool,
) -> None:
    """Write an observer and the control law around it as C without dynamic memory.

    OBSERVER is a name, or your own as package.module:Class.

    \b
    Writes a folder:
      NAME.h, NAME.c      init, step: the observer; update: the controller, sensors to gimbal rate
      NAME_example.c      program that compares the C code with the test vector
      NAME_test_vector.h  test vector

    The C code is compared with Python on random signals before it is written.
    """  # noqa: D301  (click wants the character itself)
    from cmg_mj.features.export import generate_code, write_code
    from cmg_mj.features.export.names import name_of
    from cmg_mj.features.export.pipeline import export_table
    from cmg_mj.linear.verdict import require_stable_period
    from cmg_mj.runs.experiment import prepare

    experiment = prepare(RunArguments(scenario, settings, None, out, as_json).scenario(observer))
    controller = experiment.axis_controller("export").axes[0]
    require_stable_period(experiment.law, experiment.plant.reduced)
    note_hints(experiment.hints)
    name = name_of(controller.observer, name)
    with claim_output(out, f"export-{name}-{precision}") as folder:
        code = generate_code(controller, precision, name)
        files = write_code(folder, code)
    figures = code.figures
    show(figures, export_table(figures), as_json)
    if figures["compiler"] is None:
        note(
            "no C compiler was found (CC, cc, gcc, clang): the traced formulas were compared with Python, the C was not"
        )
    for part in figures["beyond_rounding"]:
        off = figures["c_off_by"][part]
        note(f"hint: {part} is off by {off:.2g} in {precision} precision: the observer amplifies last digits")
    at = files[0].parent
    compile_it = shell_command("cc", "-std=c99", at / f"{name}.c", at / f"{name}_example.c", "-lm")
    say_written(folder, at, f"Try it: {compile_it} && ./a.out", as_json)
