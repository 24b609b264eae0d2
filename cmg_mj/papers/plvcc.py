"""The appendix of aranovskiy2020 and Proposition 1 of sokolov2019: the gyroscope is not PLvCC, checked symbolically.

No full-rank Psi(q) makes every B_(i) of M = diag(m1(q2), 1) skew-symmetric. `plvcc_geometry.py` has the definition and
the argument in three steps; `proof` checks each of them, and decides on the papers' m1 and on inertias for which the
answer is yes. sympy takes most of a second to import, so it is imported where it is used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from cmg_mj.papers.claim import Claim
from cmg_mj.papers.plvcc_geometry import (
    B,
    Decision,
    condition,
    coordinates,
    decide,
    is_skew,
    lie_derivative,
    vanishes,
)

Paper = Literal["aranovskiy2020", "sokolov2019"]


class PrintedInertia(NamedTuple):
    """A paper's inertia as printed.

    Attributes:
        place: Place at which it says that the system is not PLvCC.
        gimbals: Number of gimbals.
        factor: The factor before (J1 + J2 cos^2 q2)/(I_c + I_d) in m1.
        arm: Distance from the tilt axis of the mass m, which J1 holds as m arm^2/gimbals [m].
    """

    place: str
    gimbals: int
    factor: int
    arm: str


PRINTED: dict[Paper, PrintedInertia] = {
    "aranovskiy2020": PrintedInertia("Appendix", 2, 2, "0.19"),
    "sokolov2019": PrintedInertia("Proposition 1", 1, 1, "0.13"),
}


# --- the papers' inertia ------------------------------------------------------------------------------------


def papers_m1(paper: Paper, numbers: bool = False) -> Any:
    """Return m1 as printed, with the symbols J1, J2 and I_c + I_d, or with the exact numbers of Table 1 (Table I)."""
    import sympy as sp

    q2 = coordinates()[1]
    J1, I_cd = sp.symbols("J1 I_cd", positive=True)
    J2 = sp.Symbol("J2", real=True, nonzero=True)
    m1 = PRINTED[paper].factor * (J1 + J2 * sp.cos(q2) ** 2) / I_cd
    if not numbers:
        return m1
    m, arm2 = sp.Rational("2.62"), sp.Rational(PRINTED[paper].arm) ** 2 / PRINTED[paper].gimbals
    J_b, I_c, J_c, K_c = (sp.Rational(text) / 10**4 for text in ("130", "10", "2.6", "9.9"))
    I_d, J_d = (sp.Rational(text) / 10**4 for text in ("5.6", "11"))
    return m1.subs({J1: I_d + J_b + K_c + m * arm2, J2: J_c - I_d + J_d - K_c, I_cd: I_c + I_d})


def inertia_factor(paper: Paper) -> Any:
    """Return the s of m1 = s (J1 + J2 cos^2 q2)/(I_c + I_d) for which the motion is that of diag(m1, 1).

    With T = (M11 w_b^2 + M22 w_c^2)/2, the gimbal's equation is M22 w_c' - M11' w_b^2/2. In both papers the quotient of
    those terms is (J2/2) sin(2 q_c)/(I_c + I_d), with M11 = n (J1 + J2 cos^2 q_c) for n gimbals.
    """
    import sympy as sp

    J1, J2, I_cd, q_c = sp.symbols("J1 J2 I_cd q_c", positive=True)
    one_gimbal = J1 + J2 * sp.cos(q_c) ** 2
    M11 = PRINTED[paper].gimbals * one_gimbal
    M22 = -sp.diff(M11, q_c) / 2 / (J2 / 2 * sp.sin(2 * q_c) / I_cd)
    return sp.simplify(M11 / M22 * I_cd / one_gimbal)


# --- the proof's steps --------------------------------------------------------------------------------------


def jet(name: str) -> Any:
    """Write a function by its value and first derivatives at q = 0, `name + name_1 q1 + name_2 q2`.

    B_(i) holds no higher derivatives, and q = 0 may be any point: what is so for these is so for all functions.
    """
    import sympy as sp

    q1, q2 = coordinates()
    value, first, second = sp.symbols(f"{name} {name}_1 {name}_2")
    return value + first * q1 + second * q2


def any_psi() -> Any:
    """Return any Psi(q), to first order at q = 0, (2, 2)."""
    import sympy as sp

    return sp.Matrix([[jet("a"), jet("b")], [jet("c"), jet("d")]])


def any_m1() -> Any:
    """Return diag(m1(q2), 1) with any m1, to first order at q = 0, (2, 2)."""
    import sympy as sp

    return sp.diag(jet("m").subs(sp.Symbol("m_1"), 0), 1)


def symmetric_part_is_lie_derivative(i: int, M: Any) -> bool:
    """Step 1 for one column and any Psi, at q = 0."""
    Psi, origin = any_psi(), dict.fromkeys(coordinates(), 0)
    matrix = B(i, Psi, M, origin)
    return all(vanishes(entry) for entry in matrix + matrix.T - lie_derivative(Psi[:, i], M).subs(origin))


def printed_entries() -> dict[str, bool]:
    """Compare the definition with the appendix's entries of B_(2), for any Psi and any m1(q2)."""
    import sympy as sp

    matrix = B(1, any_psi(), any_m1(), dict.fromkeys(coordinates(), 0))
    m, dm, d, b_1, b_2, d_1, d_2 = sp.symbols("m m_2 d b_1 b_2 d_1 d_2")
    pairs = {
        "B_(2)22": (matrix[1, 1], -d_2),
        "B_(2)11": (matrix[0, 0], (-2 * m * b_1 - d * dm) / (2 * m**2)),
        "B_(2)12 + B_(2)21": (matrix[0, 1] + matrix[1, 0], -(d_1 + m * b_2) / m),
    }
    return {name: vanishes(entry - formula) for name, (entry, formula) in pairs.items()}


def mixed_derivatives(sign: int = 1) -> bool:
    """Step 2: whether the two expressions for db/dq demand m1 (m1'/m1)' d = sign * 2 d''.

    The appendix prints it with the other sign, which does not touch its conclusion.
    """
    import sympy as sp

    q1, q2 = coordinates()
    m1, d = sp.Function("m1")(q2), sp.Function("d")(q1)
    db_dq1 = -d / (2 * m1) * sp.diff(m1, q2)
    db_dq2 = -sp.diff(d, q1) / m1
    difference = sp.diff(db_dq1, q2) - sp.diff(db_dq2, q1)
    demanded = condition(m1) * d - sign * 2 * sp.diff(d, q1, 2)
    return vanishes(2 * m1 * difference + demanded)


def zero_d_is_singular() -> bool:
    """Return true if d = 0 with a constant b, the appendix's trivial solution, leaves a singular Psi (it does not)."""
    import sympy as sp

    Psi = sp.Matrix([[0, 1], [1, 0]])
    return not (all(is_skew(B(i, Psi, sp.eye(2))) for i in range(2)) and Psi.det() != 0)


@dataclass(frozen=True)
class Proof:
    """The checked steps and decisions of a paper's proof.

    Attributes:
        steps: Step in words -> whether it was found so.
        decisions: The decisions on the paper's m1, with symbols and with the numbers of its table.
        checks: The decisions on inertias that are PLvCC, constant m1 first.
    """

    steps: Mapping[str, bool]
    decisions: tuple[Decision, Decision]
    checks: tuple[Decision, ...]

    @property
    def failures(self) -> list[str]:
        """The failures: a step, a Psi for the paper's m1, no Psi for an m1 that has one."""
        failures = [name for name, right in self.steps.items() if not right]
        failures += [f"m1 = {decision.m1}: a Psi was found" for decision in self.decisions if decision.plvcc]
        return failures + [f"m1 = {decision.m1}: no Psi was found" for decision in self.checks if not decision.plvcc]


def proof(paper: Paper) -> Proof:
    """Check the proof, step by step, and the counter-checks."""
    import sympy as sp

    q2 = coordinates()[1]
    A, D, k = sp.symbols("A D k", positive=True)
    f, family = sp.Function("f")(q2), (A * sp.exp(k * q2) + D * sp.exp(-k * q2)) ** 2
    steps = {f"{name} is as printed": right for name, right in printed_entries().items()}
    for i in range(2):
        steps[f"B_({i + 1}) is skew-symmetric exactly if column {i + 1} is a Killing field"] = (
            symmetric_part_is_lie_derivative(i, any_m1())
        )
    steps["the mixed derivatives of b demand m1 (m1'/m1)' d = 2 d''"] = mixed_derivatives()
    steps["for m1 = f^2, m1 (m1'/m1)' is constant exactly if f''/f is"] = vanishes(
        sp.diff(condition(f**2), q2) - 2 * f**2 * sp.diff(sp.diff(f, q2, 2) / f, q2)
    )
    steps["it is 8 A D k^2 for f = A exp(k q2) + D exp(-k q2)"] = vanishes(condition(family) - 8 * A * D * k**2)
    decisions = (decide(papers_m1(paper)), decide(papers_m1(paper, numbers=True)))
    checks = tuple(decide(m1) for m1 in (sp.Symbol("J1", positive=True), sp.exp(2 * k * q2), sp.cosh(k * q2) ** 2))
    return Proof(steps, decisions, checks)


# --- the claim ----------------------------------------------------------------------------------------------


def claim(paper: Paper) -> Claim:
    """Judge the appendix of aranovskiy2020, or Proposition 1 of sokolov2019, whose proof is not printed there."""
    result = proof(paper)
    symbolic, numeric = result.decisions
    gap, factor, printed_factor = not zero_d_is_singular(), inertia_factor(paper), PRINTED[paper].factor
    remarks = {
        "The printed proof has a gap: d = 0 alone does not make Psi singular (m1 = 1, Psi = [[0, 1], [1, 0]]). The "
        "same argument for c, from B_(1), closes the gap: m1 (m1'/m1)' not constant makes both c and d zero.": gap,
        "The equality of the mixed derivatives is printed with a wrong sign: it is "
        "m1 (m1'/m1)' d = +2 d''.": mixed_derivatives() and not mixed_derivatives(sign=-1),
        f"By (2) the factor before (J1 + J2 cos^2 q2)/(I_c + I_d) is {factor}, not {printed_factor}, since both "
        "gimbals turn; the conclusion is the same for any factor.": factor != printed_factor,
    }
    on_printed_proof = " ".join(remark for remark, is_so in remarks.items() if is_so)
    return Claim(
        place=PRINTED[paper].place,
        statement="No full-rank Psi(q) makes B_(1) and B_(2) skew-symmetric: the system is not partially linearisable "
        "via coordinate changes.",
        holds=not result.failures,
        conditions=on_printed_proof if paper == "aranovskiy2020" else "",
        otherwise=f"Not found so: {'; '.join(result.failures)}.",
        figures={
            "steps": dict(result.steps),
            "papers_m1": _plain(symbolic),
            "table_numbers": _plain(numeric),
            "counter_checks": [_plain(decision) | {"Psi": _text(decision.Psi)} for decision in result.checks],
            "d_zero_alone_is_singular": not gap,
            "factor_of_m1_by_the_equations": int(factor),
            "factor_of_m1_printed": printed_factor,
        },
    )


def _text(matrix: Any) -> str:
    return "none" if matrix is None else str(matrix.tolist())


def _plain(decision: Decision) -> dict[str, Any]:
    values = {str(angle): str(value) for angle, value in decision.values.items()}
    return {"m1": str(decision.m1), "plvcc": decision.plvcc, "condition_by_q2": values}
