"""Table 2 of aranovskiy2020: its observers' parameters beside those that Section V's tuning finds here."""

from __future__ import annotations

from cmg_mj.features.tuning import NoiseLevelResult
from cmg_mj.papers.aranovskiy2020.joint import (
    UNRECORDED,
    JointExperiment,
    assumed,
    is_best,
    joint_claim,
    nearest_joint,
)
from cmg_mj.papers.aranovskiy2020.retuned import (
    CASES,
    SEED,
    WORLDS,
    Studies,
    Tuning,
    all_studies,
    beats_zero,
)
from cmg_mj.papers.aranovskiy2020.tuning_procedure import LOOP_SHARE, procedure_claim, run_trials
from cmg_mj.papers.claim import Claim, OnShare


def table_2_claim(case: Tuning, studies: Studies, experiment: JointExperiment) -> Claim:
    """Judge Table 2's line of one observer in the experiment that all three lines come nearest to."""
    level = experiment.levels[case.observer]
    is_tunable = beats_zero(level)
    return Claim(
        place=f"Table 2, {case.equation}",
        statement=f"{case.table_line}, tuned to fit the gyro best.",
        assumes=assumed(experiment),
        missing_data=UNRECORDED,
        holds=is_best(level) and is_tunable,
        conditions=f"In an experiment that is the same for all three lines. {_describe_first_push(case, studies)}",
        otherwise=(
            f"In the experiment in which all three could have been tuned they have {level.ratio.mean:.2f} times the "
            f"error of the tuned. {_describe_single_line(case, studies)}"
            if is_tunable
            else "In the experiment nearest to one for all three an estimate of zero is closer to the gyro."
        ),
        figures={
            push: {
                "noise_density_ug_rthz": [level.noise_ug_rthz for level in by_name[case.observer].levels],
                "tuned": [dict(level.sizes) for level in by_name[case.observer].levels],
                "table_2_by_tuned_error": [level.ratio for level in by_name[case.observer].levels],
                "table_2_error_rad_s": [float(level.given_rms.mean()) for level in by_name[case.observer].levels],
                "tuned_error_rad_s": [float(level.rms.mean()) for level in by_name[case.observer].levels],
                "zero_estimate_error_rad_s": [level.zero_rms for level in by_name[case.observer].levels],
                "tuned_is": [level.verdict for level in by_name[case.observer].levels],
            }
            for push, by_name in studies.items()
        },
    )


def _describe_first_push(case: Tuning, studies: Studies) -> str:
    """Describe the loss under the push of Figs 5 to 7, at the noise at which it is least there."""
    push = next(iter(studies))
    level = least_lost(case, studies)
    zero_note = "" if beats_zero(level) else ", where an estimate of zero is closer than either"
    return (
        f"Under {push} they lose least at {level.noise_ug_rthz:g} ug/rtHz: {level.ratio.mean:.2f} times the error of "
        f"the tuned{zero_note}."
    )


def _describe_single_line(case: Tuning, studies: Studies) -> str:
    level = least_lost(case, studies)
    return _describe_first_push(case, studies) + (
        " The best experiment for this line alone is not the best for the other two." if is_best(level) else ""
    )


def least_lost(case: Tuning, studies: Studies) -> NoiseLevelResult:
    """Return the level at which Table 2's line loses least under the first push, that of Figs 5 to 7."""
    return min(next(iter(studies.values()))[case.observer].levels, key=lambda level: level.ratio.mean)


def claims(on_share: OnShare) -> list[Claim]:
    """Judge section V's procedure, whether Table 2 is one experiment's, and a line of it an observer."""
    studies = all_studies(SEED, WORLDS, lambda share: on_share((1.0 - LOOP_SHARE) * share))
    experiment = nearest_joint(studies)
    loops = run_trials(studies, experiment, lambda share: on_share(1.0 - LOOP_SHARE * (1.0 - share)))
    return [
        procedure_claim(studies, loops),
        joint_claim(studies),
        *(table_2_claim(case, studies, experiment) for case in CASES),
    ]
