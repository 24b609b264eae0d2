"""A toy for boards: a controller written by hand that does what a test asks of it, and a short run."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmg_mj.features.board.image import build, missing
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario

needs_board = pytest.mark.skipif(bool(missing()), reason=f"not installed: {', '.join(missing())}")

SHORT = ("duration_s=0.5", "plant.initial_tilt_deg=0.5", "push=[]")


def short(observer: str, *settings: str) -> Experiment:
    """Half a second in which the rig comes back."""
    return prepare(load_scenario("push_recovery", [*SHORT, *settings], observer))


HEADER = """
#define TOY_ESTIMATES 4
#define TOY_ENCODERS 2
typedef float toy_real;
typedef enum { TOY_OK, TOY_INPUT_NOT_FINITE, TOY_RESULT_NOT_FINITE } toy_status;
typedef struct { toy_real steps; } toy_state;
typedef struct { toy_state observer; toy_real x_e; toy_real u; int started; } toy_controller;
void toy_init(toy_state *state, toy_real y1, toy_real y2, toy_real acceleration);
void toy_step(toy_state *state, toy_real y1, toy_real y2, toy_real acceleration, toy_real u, toy_real estimate[4]);
void toy_start(toy_controller *controller);
toy_status toy_update(toy_controller *controller, const toy_real accelerations[4], const toy_real encoders[2],
                      toy_real estimate[4], toy_real *u);
"""
SOURCE = """
#include "toy.h"

void toy_init(toy_state *s, toy_real y1, toy_real y2, toy_real acceleration)
{
    (void)y1, (void)y2, (void)acceleration;
    s->steps = 0;
}

void toy_step(toy_state *s, toy_real y1, toy_real y2, toy_real acceleration, toy_real u, toy_real estimate[4])
{
    %(step)s
    estimate[0] = y1, estimate[1] = y2, estimate[2] = acceleration, estimate[3] = u;
    s->steps++;
}

void toy_start(toy_controller *c)
{
    toy_init(&c->observer, 0, 0, 0);
    c->x_e = 0;
}

toy_status toy_update(toy_controller *c, const toy_real a[4], const toy_real e[2], toy_real estimate[4], toy_real *u)
{
    %(update)s
    toy_step(&c->observer, a[0], a[1], a[2], a[3], estimate);
    c->x_e += e[1];
    *u = e[0] + 10 * e[1] + 100 * c->observer.steps;
    return TOY_OK;
}
"""


def toy(folder: Path, update: str = "", step: str = "") -> Path:
    """Build it.

    Args:
        folder: Where.
        update: C at the beginning of an update; `e[0]` is what the first encoder shows.
        step: C at the beginning of a step of the observer.

    Returns:
        The image.
    """
    (folder / "toy.h").write_text(HEADER)
    (folder / "toy.c").write_text(SOURCE % {"update": update, "step": step})
    return build("toy", folder).path
