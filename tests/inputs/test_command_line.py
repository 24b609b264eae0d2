"""Wrong options, and folders that cannot be written: one clear line before anything is run."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import cmg_mj
from tests.inputs.complaints import assert_in_order, table


@table(
    ("no equals sign", ["--set", "seed"], "--set 'seed': write section.field=value, for example plant."),
    ("no name", ["--set", "=3"], "--set '=3': write section.field=value"),
    ("two dots", ["--set", "plant..x=1"], "--set 'plant..x=1': write section.field=value"),
    ("unknown section", ["--set", "plnt.x=1"], "with --set plnt.x=1: plnt: no such field; did you mean 'plant'?"),
    ("unknown field", ["--set", "plant.modl=1"], "with --set plant.modl=1: plant.modl: no such field; did you mean"),
    ("text for a number", ["--set", "observer.k1=abc"], "with --set observer.k1=abc: observer.k1 = 'abc': "),
    ("no value", ["--set", "observer.k1="], "observer.k1 = '': "),
    ("two settings in one", ["--set", "seed=1\nduration_s=3"], "seed = '1\\nduration_s=3': "),
    ("wrong list", ["--set", "controller.gains=[1,2]"], "controller.gains = [1, 2]: "),
    ("no such push", ["--set", "push.3.torque_n_m=1"], "there is no push.3; it has 1 of them, counted from 0"),
    ("which push", ["--set", "push.torque_n_m=1"], "push is not a section; write for example push.0.torque_n_m=2.0"),
    ("a push's number in letters", ["--set", "push.².torque_n_m=1"], "there is no push.²"),
    ("below a field", ["--set", "plant.model.x=3"], "plant.model is not a section"),
    ("a section's value", ["--set", "plant=3"], "plant = 3: must be a section"),
    ("a law's value", ["--set", "controller.kind=lqg", "--set", "controller=3"], "controller = 3: must be a section"),
    ("a negative seed", ["--seed", "-1"], "Invalid value for '--seed': -1 is not in the range 0<=x<="),
    ("a seed in letters", ["--seed", "x"], "Invalid value for '--seed': 'x'"),
    ("unknown option", ["--sed", "3"], "No such option", "--sed", "--seed"),
    ("too many words", ["and_more"], "unexpected extra argument (and_more)"),
    ("no folder's name", ["--out", ""], "--out '': name a folder"),
)
@pytest.mark.parametrize("command", ["run", "compare"])
def test_options(command: str, wrong_input: list[str], fragments: list[str]) -> None:
    assert_in_order(fragments, cmg_mj(command, "push_recovery", *wrong_input).complaint)
    assert list(Path().iterdir()) == []


@table(
    ("run", ["run", "push_recovery", "--observer", "ltvv"], "--observer 'ltvv': no such observer; did you mean 'ltv'?"),
    (
        "another's parameter",
        ["run", "push_recovery", "--observer", "ltv", "--set", "observer.k1=3"],
        "push_recovery with --observer ltv --set observer.k1=3: observer.k1: no such field of ltv",
    ),
    (
        "driver",
        ["run", "push_recovery", "--driver", "native!"],
        "'--driver': 'native!' is not one of 'native', 'callback'",
    ),
    ("compare", ["compare", "push_recovery", "--observers", "ltv,linera"], "--observers 'linera': ", "mean 'linear'?"),
    (
        "no observers",
        ["compare", "push_recovery", "--observers", " , "],
        "--observers ' , ': give names separated by commas",
    ),
    ("no worlds", ["compare", "push_recovery", "--worlds", "0"], "Invalid value for '--worlds': 0"),
    (
        "for one that is not compared",
        ["compare", "push_recovery", "--observers", "ltv", "--set", "observer.k1=3"],
        "--set observer.k1=3: is a setting of homogeneous, which is not among --observers ltv",
    ),
    ("no scenario", ["run"], "Missing argument 'SCENARIO'"),
    ("command", ["rnu", "push_recovery"], "No such command 'rnu'"),
    ("list", ["list", "observer"], "'observer' is not one of 'scenarios', 'observers'"),
)
def test_commands(wrong_input: list[str], fragments: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmg_mj.runs.experiment.Experiment.simulate", pytest.fail)  # all is found before a run
    assert_in_order(fragments, cmg_mj(*wrong_input).complaint)
    assert list(Path().iterdir()) == []


@table(
    ("a file", "taken", "--out taken: cannot be written: "),
    ("below a file", "taken/run", "--out taken/run: cannot be written: "),
    ("no place for files", "/proc/cmg-mj", "--out /proc/cmg-mj: cannot be written: "),
    ("a device", "/dev/null", "--out /dev/null: cannot be written: "),
)
@pytest.mark.parametrize("command", ["run", "compare"])
def test_an_output_folder_that_cannot_be_written(
    command: str, wrong_input: str, fragments: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cmg_mj.runs.experiment.Experiment.simulate", pytest.fail)
    Path("taken").write_text("mine")
    assert_in_order(fragments, cmg_mj(command, "push_recovery", "--out", wrong_input).complaint)
    assert Path("taken").read_text() == "mine"
