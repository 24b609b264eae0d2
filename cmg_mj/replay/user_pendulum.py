"""The pendulum of a log: a rig, or numbers of the user's own."""

from __future__ import annotations

from cmg_mj.errors import InputError
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.replay.parameter_options import numbers
from cmg_mj.scenario.loading import parse_scenario
from cmg_mj.scenario.plant_parameters import PlantParameters
from cmg_mj.scenario.schema import Scenario
from cmg_mj.simulation.experiment import prepare

NUMBERS = {
    "inertia": "tilt inertia about the pivot, J1 [kg m^2]",
    "gravity_torque": "mass x gravity x height of its centre, positive if it falls over [N m]",
    "momentum": "spin momentum of the flywheels together, J_d omega_d [N m s]",
    "gimbal_inertia": "what the gimbals' turn by 90 degrees adds to the inertia, J2 [kg m^2]",
}
"""Of `--model`: the first two must be given, the others are 0 for a pendulum without gimbals."""


def model_of(text: str) -> ReducedModel:
    """A user's pendulum.

    Args:
        text: An MJCF rig's path or bundled name, or numbers, `inertia=0.06,gravity_torque=3.4,...` (`NUMBERS`).

    Returns:
        Its reduced model.

    Raises:
        InputError: There is no such file or rig, or the numbers are not as they must be.
    """
    if "=" not in text:
        return rig_of(parse_scenario({"plant": {"model": text}}, f"--model {text}")).reduced
    found = numbers(text, "--model", NUMBERS)
    for name in ("inertia", "gravity_torque"):
        if name not in found:
            raise InputError(f"--model: {name} is missing: {NUMBERS[name]}")
    inertia, added = found["inertia"], found.get("gimbal_inertia", 0.0)
    if not inertia > 0.0 or not inertia + added > 0.0:
        raise InputError("--model: inertia, and inertia + gimbal_inertia, must be greater than 0 [kg m^2]")
    return ReducedModel(inertia, added, found.get("momentum", 0.0), 1.0, found["gravity_torque"])


def rig_of(scenario: Scenario) -> PlantParameters:
    """The parameters of a scenario's rig."""
    experiment = prepare(scenario)
    experiment.require_single_axis("replay")
    return experiment.plant.parameters
