"""The report that `cmg-mj mount` prints."""

from __future__ import annotations

import math
from collections.abc import Iterator

from cmg_mj.features.mounting.limits import LOW_LIMIT_DEG, PUSH_S, WORLDS
from cmg_mj.features.mounting.push import MAX_SEARCH_S, MIN_SHARE, OTHER_WORLDS, UNPUSHED_S, SimulatedPush
from cmg_mj.features.mounting.write import MountResult
from cmg_mj.linear.ceiling import ceiling_words, plant_words
from cmg_mj.linear.verdict import IN_THE_MODEL, NOT_IN_THE_MODEL, loop_words, measured_words, sliding_words
from cmg_mj.plant.tilt_line import HingeLine

SMALL_STEP_S = 5e-4
"""With physics steps smaller than this the search takes longer than its time on any machine [s]."""


def mount_report_lines(result: MountResult) -> Iterator[str]:
    """Describe a mounted robot and the limits of its pair, line by line.

    Args:
        result: The mounted robot.

    Yields:
        Lines.
    """
    mounted, plant = result.mounted, result.plant
    line = plant.axis.line
    joint = plant.model.joint(line.joint).name
    about = f"the hinge {joint!r}" if isinstance(line, HingeLine) else "the line that it stands on"
    body = plant.model.body(plant.axis.frame).name
    yield f"{mounted.path}: {len(plant.axis.modules)} modules on {body!r}; tilts about {about}"
    if mounted.held:
        yield f"  held where they stand: {', '.join(mounted.held)}"
    for note in mounted.notes:
        yield f"  {note}"
    file, runner = mounted.spec.option.timestep, plant.timestep
    if result.plugin and not math.isclose(file, runner):
        yield (
            f"  its physics steps of {1e3 * file:.4g} ms are {1e3 * runner:.4g} ms in the plugin's model, as in runs: "
            "whole steps fit between two samples"
        )
    yield f"  {plant_words(result.push_limits.reduced)}"
    yield f"  {ceiling_words(result.push_limits.limit)}"
    yield from _pivot(result)
    margin = result.push_limits.push_margin.median_impulse
    reduced = (
        f"by its reduced model the largest push's impulse is E = {margin:.3g} N m s, "
        f"a push of {margin / PUSH_S:.3g} N m, {result.push_limits.fraction_of_limit:.0%} of any controller's"
    )
    yield f"  {result.observer}: {_simulated(result.simulated, _advice(result))}{reduced}"
    low = math.degrees(result.push_limits.limit.tilt) < LOW_LIMIT_DEG
    if low or (result.simulated and result.simulated.falls):
        reason = f"any controller recovers less than {LOW_LIMIT_DEG:g} deg" if low else "it does not stand"
        yield f"  with a pair of this size {reason}; take a larger --scale"
    yield from _demands(result)


def _pivot(result: MountResult) -> Iterator[str]:
    """Say what a pivot that slides freely does to the tilt, and what the loop would be if the tilt did not know it."""
    rig, poles = result.plant, result.push_limits.sliding_poles
    if poles:
        yield f"  its pivot {sliding_words(rig)}"
        yield (
            f"    so the loop with the true rate is {loop_words(poles.about_centre)}; about the pivot, where "
            f"{measured_words(rig)}, it is {loop_words(poles.about_pivot)}"
        )
        if result.observer != "free_pivot":
            yield "    if what it slides on rubs, --observer free_pivot stands more of that"
        yield f"    in the reduced model: {IN_THE_MODEL}; not: {NOT_IN_THE_MODEL}"


def _advice(result: MountResult) -> str:
    """Say what to do where the time did not suffice."""
    step = result.plant.timestep
    cure = "run it again while the machine does nothing else"
    if step < SMALL_STEP_S:
        cure = f"its physics steps of {1e3 * step:.3g} ms are too many; give its file a larger <option timestep>"
    return f": {cure}; till then the scenario's push is 0.6 E"


def _simulated(simulated: SimulatedPush | None, advice: str) -> str:
    """Describe what the robot stands in MuJoCo, up to the words on the reduced model."""
    if simulated is None:
        return "not tried in MuJoCo; "
    if simulated.standing is None:
        return f"in MuJoCo nothing found within {MAX_SEARCH_S:g} s{advice}; "
    if simulated.falls:
        fallen = simulated.worlds - simulated.standing
        return (
            f"does not stand: in MuJoCo {fallen} of {simulated.worlds} worlds fall within {UNPUSHED_S:g} s, unpushed; "
        )
    if not simulated.impulse:
        reason = f"none found within {MAX_SEARCH_S:g} s{advice}"
        if simulated.complete:
            reason = f"not even {MIN_SHARE:.0%} of any controller's push"
        return f"stands in MuJoCo only unpushed ({reason}); "
    others = f"and all of {OTHER_WORLDS} others"
    more = others if simulated.complete else f"{MAX_SEARCH_S:g} s were too short to try it in {OTHER_WORLDS} others"
    return (
        f"stands a push of {simulated.impulse / PUSH_S:.3g} N m for {PUSH_S:g} s either way (MuJoCo, all of {WORLDS} "
        f"worlds, less a tenth; {more}); "
    )


def _demands(result: MountResult) -> Iterator[str]:
    """Say what the pair weighs, what its servos have to do and what its wheels take."""
    demands, simulated = result.demands, result.simulated
    taken = ""
    if simulated is not None and simulated.servo_torque is not None and simulated.servo_rate is not None:
        taken = f"; the push takes up to {simulated.servo_torque:.2g} N m and {simulated.servo_rate:.2g} rad/s"
    yield (
        f"  the pair weighs {demands.pair_mass_kg:.3g} kg, {demands.pair_mass_kg / demands.robot_mass_kg:.0%} of the "
        f"robot's {demands.robot_mass_kg:.3g} kg; its servos have {demands.servo_limit_torque_n_m:.3g} N m and "
        f"{demands.servo_limit_rate_rad_s:.3g} rad/s{taken}"
    )
    yield (
        f"  its wheels hold {demands.wheels_energy_j:.3g} J, {demands.wheels_spin_up_power_w:.2g} W for a minute to "
        f"spin up, and take {demands.wheels_holding_power_assumed_w:.2g} W to keep turning (assumed: two 608 bearings "
        "each, by SKF's friction)"
    )
