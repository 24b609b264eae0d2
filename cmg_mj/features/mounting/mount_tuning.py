"""A mounted robot's observer, tuned on the robot itself in MuJoCo."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import tomli_w

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting.largest_push import push_margin
from cmg_mj.features.mounting.mount_files import with_comment
from cmg_mj.features.tuning import NoiseLevelResult, TuningResult, tune, tuned_scenario
from cmg_mj.features.tuning.parameters import plain
from cmg_mj.observers.parameter_options import ParameterValue
from cmg_mj.results.folder import is_signed, signed, whole_file
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario

LONGEST_S = 120.0
"""The search ends after so long, with the best parameters so far [s]."""
WORLDS = 8
"""Worlds that are fitted; as many others are scored."""
TUNED_COMMENT = "# The observer's parameters, tuned on this robot by cmg-mj mount --tune"


class MountTuning(NamedTuple):
    """The observer of a mounted robot with its parameters tuned, beside those that it was mounted with."""

    study: TuningResult
    margin: float
    """E of the reduced model, as mounted [N m s]."""
    tuned_margin: float
    """E of the reduced model with the tuned parameters [N m s]."""
    in_use: bool
    """True if the scenario has the tuned parameters now."""
    whole: bool
    """True if the search came to its end."""

    @property
    def level(self) -> NoiseLevelResult:
        """The parameters and their scores."""
        return self.study.levels[0]

    def figures(self) -> dict[str, ParameterValue]:
        """Return the figures that `cmg-mj mount --tune --json` prints beside the mount's."""
        return {
            "tuned_held_out_fit": self.level.fit,
            "tuned_given_held_out_fit": self.level.given_fit,
            "tuned_push_margin_impulse_n_m_s": self.tuned_margin,
            "tuned_in_use": self.in_use,
            "tuned_whole": self.whole,
        }

    def line(self) -> str:
        """Describe the result in a line."""
        numbers = ", ".join(f"{name} {size:.4g}" for name, size in self.level.sizes.items())
        began = "tuned" if self.whole else "tuned as far as there was time"
        if self.in_use:
            verdict = "the scenario has the tuned ones"
        elif self.level.verdict != "better":
            verdict = "the scenario keeps the others, because tuned ones are not better beyond chance"
        else:
            verdict = "the scenario keeps the others, because with tuned ones it stands less"
        return (
            f"  {self.study.kind} {began} on {WORLDS} worlds: {numbers}; on {WORLDS} others its fit is "
            f"{self.level.fit:.2f} (before {self.level.given_fit:.2f}), and by the reduced model E = "
            f"{self.tuned_margin:.3g} N m s (before {self.margin:.3g}): {verdict}"
        )


def tune_mounted(
    path: Path,
    *,
    stop: Callable[[], bool] = lambda: False,
    on_share: Callable[[float], None] | None = None,
) -> MountTuning:
    """Tune the observer of a mounted robot, and write its parameters if they are better in both ways.

    The loop is closed on the gyro, as in `cmg-mj tune`, so that the smallest error may be that of an estimate near
    zero, with which nothing stands: the tuned parameters must not have a smaller E either.

    Args:
        path: The scenario that the mount has written.
        stop: Whether to end the search now.
        on_share: Called now and then with the completed share.

    Returns:
        The result.

    Raises:
        InputError: There is nothing to tune, the robot falls without its observer, or the file cannot be written.
    """
    experiment = prepare(load_scenario(str(path)))
    experiment.require_single_axis("mount --tune")
    end, stopped = time.monotonic() + LONGEST_S, False

    def over() -> bool:
        nonlocal stopped
        stopped = stopped or stop() or time.monotonic() > end
        return stopped

    study = tune(experiment.scenario, worlds=WORLDS, starts=1, on_share=on_share, stop=over)
    level = study.levels[0]
    tuned = prepare(tuned_scenario(study, level), experiment.plant)
    margins = [push_margin(loop.scenario, loop.design).median_impulse for loop in (experiment, tuned)]
    better = level.verdict == "better" and margins[1] >= margins[0]
    if better:
        _write(path, level)
    return MountTuning(study, margins[0], margins[1], better, not stopped)


def _write(path: Path, level: NoiseLevelResult) -> None:
    """Replace the parameters in a mounted robot's scenario.

    Raises:
        InputError: No mount has written it.
    """
    if not is_signed(path):
        raise InputError(f"{path}: is not a file of cmg-mj mount; the tuned parameters are not written")
    fields = tomllib.loads(path.read_text(encoding="utf-8"))
    fields["observer"] |= plain(level.parameters)
    with whole_file(path) as temporary:
        temporary.write_bytes(signed(with_comment(tomli_w.dumps(fields), TUNED_COMMENT, "[observer]"), ".toml"))
