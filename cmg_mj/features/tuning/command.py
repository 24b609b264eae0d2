"""The commands that fit an observer's parameters: to the gyro of a scenario, or to the reference of logs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from cmg_mj.cli.arguments import (
    MAX_WORLDS,
    RunArguments,
    all_of,
    assignments_option,
    claim_output,
    json_option,
    names_in,
    observer_option,
    out_option,
    run_options,
    worlds_option,
)
from cmg_mj.cli.terminal import (
    CtrlC,
    end_interrupted,
    final_path,
    progress,
    say_written,
    shell_command,
    show,
    users_code,
)
from cmg_mj.core.errors import InputError
from cmg_mj.features.replay.command import log_options, noise_option, pair, pendulum_option

if TYPE_CHECKING:
    from cmg_mj.features.replay.log import ReadOptions

parameter_options = all_of(
    click.option(
        "--parameters", default="", metavar="NAMES", help="Parameters to tune, separated by commas.  [default: all]"
    ),
    click.option(
        "--range",
        "ranges",
        multiple=True,
        metavar="NAME=LOW:HIGH",
        help="Range in which to search for a parameter. May be given again.",
    ),
)
"""The options that select the parameters to tune."""


@click.command()
@observer_option("to tune")
@run_options
@worlds_option(
    "Worlds to fit; as many more are held out for scoring.",
    default=20,
    range=(2, MAX_WORLDS // 10),  # whose trajectories are kept
)
@parameter_options
@click.option(
    "--noise-levels",
    default="",
    metavar="LIST",
    help="Accelerometer noise densities to tune at, separated by commas [ug/rtHz].  [default: the scenario's]",
)
@users_code()
def tune(
    arguments: RunArguments,
    observer: str | None,
    worlds: int,
    parameters: str,
    ranges: tuple[str, ...],
    noise_levels: str,
) -> None:
    """Fit an observer's parameters to the gyro of a scenario, as section V of aranovskiy2020 does.

    The bundled scenario observer_tuning is the experiment of that paper. The loop is closed on the gyro, whatever the
    scenario says, and its recording is replayed through the observer. The score is the RMS of the estimated rate less
    the gyro's, from each push to one second after it, on held-out worlds. The command compares this score with that of
    the given parameters (by default, the paper's). With several noise levels it also prints the level at which the
    given parameters are best.

    Writes a folder: tuned.json, and scenario.toml, which runs with the tuned observer.
    """
    from cmg_mj.features.tuning import tune as fit
    from cmg_mj.features.tuning.save import save_study, study_table
    from cmg_mj.runs.save import file_name

    scenario = arguments.scenario(observer)
    default = f"tune-{file_name(scenario.observer.kind)}-{scenario.seed}"
    densities = _densities(noise_levels)
    folder = claim_output(arguments.out, default)
    with CtrlC() as ctrl_c:
        with progress(f"{scenario.title or arguments.name}: {scenario.observer.kind}", 1.0, ctrl_c) as on_progress:
            study = fit(
                scenario,
                worlds=worlds,
                parameters=names_in(parameters),
                ranges=_ranges(ranges),
                noise_ug_rthz=densities,
                on_share=on_progress,
            )
        show(study.figures(), study_table(study), arguments.as_json)
        total = len(densities) or 1
        files = save_study(folder, study, complete=len(study.levels) == total)
    place = files[0].parent
    say_written(
        folder, place, f"Run with the tuned observer: {shell_command('cmg-mj', 'run', files[1])}", arguments.as_json
    )
    if ctrl_c.noted:
        end_interrupted(f"interrupted; {len(study.levels)} of {total} noise levels are in {final_path(folder, place)}")


@click.command("tune-log")
@click.argument("logs", metavar="LOG...", nargs=-1, required=True)
@observer_option("to tune", required=True)
@log_options
@parameter_options
@click.option(
    "--split",
    type=float,
    default=0.5,
    show_default=True,
    metavar="SHARE",
    help="Share of each log, from its start, to fit; the rest is scored.",
)
@click.option(
    "--settle-s",
    type=float,
    default=1.0,
    show_default=True,
    metavar="SECONDS",
    help="Seconds to ignore at the start of each part of a log.",
)
@click.option(
    "--closed-loop",
    metavar="SCENARIO",
    help="Scenario in whose closed loop the tuned parameters are compared with the given ones; none for no loop.  "
    "[default: push_recovery, or that of a run's recording]",
)
@pendulum_option
@noise_option
@assignments_option("Set a parameter to start from and to compare with.", "observer.NAME=VALUE")
@out_option()
@json_option()
@users_code()
def tune_log(
    options: ReadOptions,
    logs: tuple[str, ...],
    observer: str,
    parameters: str,
    ranges: tuple[str, ...],
    split: float,
    settle_s: float,
    closed_loop: str | None,
    model: str | None,
    noise: str,
    settings: tuple[str, ...],
    out: str | None,
    as_json: bool,
) -> None:
    """Fit an observer's parameters to the reference of one part of each LOG, and score them on the rest.

    \b
      cmg-mj tune-log LOG.csv --columns tilt=pitch_deg,rate=gyro_dps --observer linear

    The score is the RMS of the estimated rate less the reference, compared with that of the parameters as given. Tuned
    parameters count as better by more than 1 % and beyond chance. Sixteen short worlds compare both in a closed loop.
    Logs are read as in replay. Writes a folder with tuned.json.
    """  # noqa: D301  (click wants the character itself)
    from cmg_mj.features.replay.log_replay import model_of
    from cmg_mj.features.replay.noise import noise_numbers
    from cmg_mj.features.replay.reading import read_logs
    from cmg_mj.features.tuning.logs import loop_scenario, tune_on_logs
    from cmg_mj.features.tuning.save import save_study, study_table
    from cmg_mj.observers.parameter_options import parameters_of
    from cmg_mj.runs.save import file_name
    from cmg_mj.scenario.resolve import safe_name

    for setting in settings:
        if not setting.startswith("observer."):
            raise InputError(f"--set {setting}: write observer.PARAMETER=VALUE")
    start_parameters = parameters_of([observer + setting.removeprefix("observer") for setting in settings])
    noises = noise_numbers(noise)
    recordings = read_logs(logs, options)
    pendulum = None if model is None else model_of(model)
    loop = loop_scenario(closed_loop, recordings[0])
    folder = claim_output(out, f"tune-{file_name(observer)}-{safe_name(recordings[0].name)}")
    with CtrlC() as ctrl_c:
        with progress(f"{recordings[0].name}: {observer}", 1.0, ctrl_c) as on_progress:
            study = tune_on_logs(
                recordings,
                observer,
                model=pendulum,
                noises=noises,
                start_parameters=start_parameters.get(observer),
                split=split,
                settle_s=settle_s,
                parameters=names_in(parameters),
                ranges=_ranges(ranges),
                closed_loop=loop,
                on_share=on_progress,
            )
        show(study.figures(), study_table(study), as_json)
        (file,) = save_study(folder, study)
    tuned = " ".join(f"--set '{setting}'" for setting in study.settings())
    say_written(folder, file.parent, f"Replay it tuned: {tuned}", as_json)


def _ranges(texts: tuple[str, ...]) -> dict[str, tuple[float, float]]:
    """Parse texts such as `L=10.4:1000`."""
    parts = [text.partition("=") for text in texts]
    how = "NAME=LOW:HIGH, for example tau=0.005:0.1"
    return {name.strip(): pair(ends, ":", f"--range {name} =", how) for name, _, ends in parts}


def _densities(text: str) -> list[float]:
    """Parse noise densities separated by commas; a repeated one counts once."""
    try:
        densities = [float(part) for part in names_in(text)]
    except ValueError:
        densities = []
    if (text and not densities) or not all(0.0 <= density < math.inf for density in densities):
        raise InputError(f"--noise-levels {text!r}: must be numbers not below 0, separated by commas")
    return list(dict.fromkeys(densities))
