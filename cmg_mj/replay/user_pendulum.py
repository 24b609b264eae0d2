"""The pendulum of a log: a plant's MJCF, or the user's own numbers."""

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
"""Numbers of `--model`. The first two are required; the others are 0 for a pendulum without gimbals."""


def model_of(text: str) -> ReducedModel:
    """Return the reduced model of a user's pendulum.

    Args:
        text: Path or bundled name of a plant's MJCF, or numbers, `inertia=0.06,gravity_torque=3.4,...` (`NUMBERS`).

    Returns:
        The reduced model.

    Raises:
        InputError: There is no such file, or a number is missing or impossible.
    """
    if "=" not in text:
        return plant_parameters_of(parse_scenario({"plant": {"model": text}}, f"--model {text}")).reduced
    values = numbers(text, "--model", NUMBERS)
    for name in ("inertia", "gravity_torque"):
        if name not in values:
            raise InputError(f"--model: {name} is missing: {NUMBERS[name]}")
    inertia, added = values["inertia"], values.get("gimbal_inertia", 0.0)
    if not inertia > 0.0 or not inertia + added > 0.0:
        raise InputError("--model: inertia, and inertia + gimbal_inertia, must be greater than 0 [kg m^2]")
    return ReducedModel(inertia, added, values.get("momentum", 0.0), 1.0, values["gravity_torque"])


def plant_parameters_of(scenario: Scenario) -> PlantParameters:
    """Return the parameters of a scenario's plant."""
    experiment = prepare(scenario)
    experiment.require_single_axis("replay")
    return experiment.plant.parameters
