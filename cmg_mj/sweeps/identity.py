"""What a study is: its fields with every default written out."""

from __future__ import annotations

from typing import Any

from cmg_mj.experiment import prepare
from cmg_mj.sweeps.study import Study


def resolved(study: Study) -> dict[str, Any]:
    """The study with every default of its scenario written out: it reruns from that."""
    fields = prepare(study.scenario).resolved()
    varied = [field for axis in study.axes for field in axis.fields]
    for field in varied:
        section, _, name = field.rpartition(".")
        if field == "plant.timestep_s" or section != "plant":
            continue
        fields["plant"].pop(name, None)
    if study.scenario.plant.timestep_s is None:
        fields["plant"].pop("timestep_s", None)
    weights = study.scenario.controller.lqr
    if weights is not None:  # solved for anew on every rig
        fields["controller"]["lqr"] = weights.model_dump(mode="json")
    if weights is not None or any(f"{field}.".startswith("controller.lqr.") for field in varied):
        fields["controller"].pop("gains")
    return study.as_fields(fields)
