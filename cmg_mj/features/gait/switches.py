"""Two foot switches: a threshold, a delay, contacts that bounce, and what the controller makes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import and_, or_
from typing import ClassVar, NamedTuple

from cmg_mj.core.arrays import Scalar, where
from cmg_mj.core.noise import NoiseStream
from cmg_mj.core.sensor import steps_until
from cmg_mj.core.straight_line import Tables
from cmg_mj.features.gait import Gait


class Foot(NamedTuple):
    """The memory of a foot's switch; 1 is pressed."""

    pressed: Scalar
    """At the last tick."""
    stands: Scalar
    """As the controller has it."""
    since: Scalar
    """Ticks since the last change."""
    late: tuple[Scalar, ...]
    """The last readings, the newest first: so many as the delay spans."""
    agreeing: tuple[Scalar, ...]
    """The last delivered ones, the newest first: so many as a bounce takes, and one more."""


@dataclass(frozen=True)
class FootSwitches:
    """Says of each foot whether it stands, once a control tick.

    A switch is closed from a force on. After a change it bounces: its reading is open or closed at random for a while.
    A foot counts as changed once its readings have agreed for longer than that.

    Attributes:
        threshold: Force from which it is closed [N].
        delay: Its delay in ticks.
        bounce: Ticks for which it bounces.
    """

    threshold: float
    delay: int
    bounce: int

    draws: ClassVar[dict[int, int]] = {int(NoiseStream.FOOT_SWITCH): 2}

    def init(self, forces: Sequence[Scalar]) -> tuple[Foot, ...]:
        """Return the memory, from the forces on the feet at the first tick [N]."""
        feet = []
        for force in forces:
            pressed = where(force > self.threshold, 1.0, 0.0)
            since = 0.0 * force + self.bounce
            feet.append(Foot(pressed, pressed, since, (pressed,) * (1 + self.delay), (pressed,) * (1 + self.bounce)))
        return tuple(feet)

    def step(
        self, feet: Sequence[Foot], forces: Sequence[Scalar], tick: int, tables: Tables
    ) -> tuple[tuple[Foot, ...], list[Scalar]]:
        """Read both switches: return the next memory, and 1 for each foot that stands.

        Args:
            feet: The memory.
            forces: On both feet [N].
            tick: The tick's number.
            tables: The noise.
        """
        normals = tables[NoiseStream.FOOT_SWITCH](tick)
        after = tuple(self._read(*parts) for parts in zip(feet, forces, normals, strict=True))
        return after, [foot.stands for foot in after]

    def _read(self, foot: Foot, force: Scalar, normal: Scalar) -> Foot:
        pressed = where(force > self.threshold, 1.0, 0.0)
        since = where(pressed != foot.pressed, 0.0, foot.since + 1.0)
        bouncing = where(normal > 0.0, 1.0, 0.0)
        shown = where(since < self.bounce, bouncing, pressed)
        late = (shown, *foot.late[:-1])
        agreeing = (late[-1], *foot.agreeing[:-1])
        closed = [reading > 0.5 for reading in agreeing]
        opened = [reading < 0.5 for reading in agreeing]
        stands = where(or_(reduce(and_, closed), reduce(and_, opened)), agreeing[0], foot.stands)
        return Foot(pressed, stands, since, late, agreeing)


def foot_switches(gait: Gait, dt: float) -> FootSwitches:
    """Make the switches of a gait, read every dt [s]."""
    delay, bounce = (steps_until(time, dt) for time in (gait.switch_delay_s, gait.switch_bounce_s))
    return FootSwitches(gait.switch_force_n, delay, bounce)
