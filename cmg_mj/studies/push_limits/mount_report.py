"""The report that `cmg-mj mount` prints."""

from __future__ import annotations

from collections.abc import Iterator

from cmg_mj.plant.tilt_line import HingeLine
from cmg_mj.studies.push_limits.largest_push import PUSH_S
from cmg_mj.studies.push_limits.mount_files import MountResult
from cmg_mj.studies.push_limits.prospects import LOW_LIMIT_DEG


def mount_report_lines(result: MountResult) -> Iterator[str]:
    """Describe a mounted robot and the limits of its pair, line by line.

    Args:
        result: The mounted robot.

    Yields:
        Lines.
    """
    mounted, plant, figures = result.mounted, result.plant, result.prospects.figures()
    line = plant.axis.line
    joint = plant.model.joint(line.joint).name
    about = f"the hinge {joint!r}" if isinstance(line, HingeLine) else "the line that it stands on"
    body = plant.model.body(plant.axis.frame).name
    yield f"{mounted.path}: {len(plant.axis.modules)} modules on {body!r}; tilts about {about}"
    if mounted.held:
        yield f"  held where they stand: {', '.join(mounted.held)}"
    for note in mounted.notes:
        yield f"  {note}"
    yield (
        f"  inertia {figures['inertia_kg_m2']:.4g} kg m^2, gravity {figures['gravity_torque_n_m']:.4g} N m, momentum "
        f"{figures['momentum_n_m_s']:.4g} N m s, falls with {figures['pole_1_s']:.3g} 1/s"
    )
    yield (
        f"  any controller: recovers from at most {figures['limit_tilt_deg']:.3g} deg, or a push of "
        f"{figures['limit_push_torque_n_m']:.3g} N m for {PUSH_S:g} s"
    )
    yield (
        f"  this controller: recovers from a push of {figures['push_margin_torque_n_m']:.3g} N m for {PUSH_S:g} s (E = "
        f"{figures['push_margin_impulse_n_m_s']:.3g} N m s, {result.prospects.fraction_of_limit:.0%} of that)"
    )
    scale = result.sufficient_scale
    if scale is not None:
        yield f"  a pair of this size recovers less than {LOW_LIMIT_DEG:g} deg: --scale {scale:g} suffices"
    elif figures["limit_tilt_deg"] < LOW_LIMIT_DEG:
        yield f"  a pair recovers less than {LOW_LIMIT_DEG:g} deg at any scale that it has room for"
