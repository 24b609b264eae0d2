"""Is a mechanical system partially linearisable via coordinate changes (PLvCC)? Decided symbolically.

The appendix of aranovskiy2020 and Proposition 1 of sokolov2019 say that the gyroscope with M = diag(m1(q2), 1) is
not: no full-rank Psi(q) makes every B_(i) skew-symmetric. The argument, of which `proof` checks every step:

1. B_(i) + B_(i)' is the Lie derivative of the inverse of M along the column Psi_i. So B_(i) is skew-symmetric exactly
   if Psi_i is a Killing field of the metric M, whatever the other column is.
2. A Killing field (b, d) of diag(m1(q2), 1) has d = d(q1), and m1 (m1'/m1)' d = 2 d''. If d is not zero at some q1,
   then m1 (m1'/m1)' is a constant. If it is zero everywhere, for both columns, the second row of Psi is zero.
3. Where m1 (m1'/m1)' is a constant C, Psi = [[1, b], [0, d]] with d'' = C d/2 does it: the condition is sufficient
   too. det Psi = d. For C >= 0 it is nowhere zero; for C < 0 Psi has full rank on strips of q1 only. Constant C means
   m1 = f^2 with f'' = k f, and an f without zeros on the whole line has C >= 0.

sympy takes most of a second to import, so it is imported where it is used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from cmg_mj.papers.claim import Claim, verdict

Paper = Literal["aranovskiy2020", "sokolov2019"]

PLACES: dict[Paper, str] = {"aranovskiy2020": "Appendix", "sokolov2019": "Proposition 1"}


class UndecidedError(ValueError):
    """Neither a Psi nor a contradiction was found."""


# --- the definition -----------------------------------------------------------------------------------------


def coordinates() -> tuple[Any, Any]:
    """The symbols q1 (tilt) and q2 (gimbal angle)."""
    import sympy as sp

    return sp.symbols("q1 q2", real=True)


def bracket(X: Any, Y: Any) -> Any:
    """The Lie bracket [X, Y] = dY/dq X - dX/dq Y, as sokolov2019 prints it, (2, 1).

    aranovskiy2020 prints q_i and q_j for q, which gives no vector.
    """
    q = coordinates()
    return Y.jacobian(q) * X - X.jacobian(q) * Y


def B(i: int, Psi: Any, M: Any, at: Mapping[Any, Any] | None = None) -> Any:
    """B_(i), aranovskiy2020 appendix, (2, 2).

    Args:
        i: Number of the column of Psi, from 0.
        Psi: The change of velocities, (2, 2).
        M: The inertia matrix, (2, 2).
        at: Where to evaluate it, coordinate -> value. Putting that in early keeps the expressions small.
    """
    import sympy as sp

    q = coordinates()

    def put(matrix: Any) -> Any:
        return matrix.subs(at) if at else matrix

    N = Psi.T * M * Psi
    first, second = put(M * Psi * Psi.T).inv(), put(N).inv()
    result = sp.zeros(2, 2)
    for j in range(2):
        result += put(bracket(Psi[:, i], Psi[:, j]) * Psi[:, j].T) * first
        derivative = -second * put(N.diff(q[j])) * second  # of the inverse of N
        result += sp.Rational(1, 2) * put(Psi[j, i] * Psi) * derivative * put(Psi.T)
    return result


def lie_derivative(X: Any, M: Any) -> Any:
    """The Lie derivative of the inverse of M along X, (2, 2): zero exactly if X is a Killing field of M."""
    import sympy as sp

    q = coordinates()
    inverse = M.inv()
    along = sum((X[k] * inverse.diff(q[k]) for k in range(2)), sp.zeros(2, 2))
    return along - X.jacobian(q) * inverse - inverse * X.jacobian(q).T


def vanishes(expression: Any) -> bool:
    """Whether a quotient of polynomials in q, sines, cosines and exponentials is zero.

    sympy's simplify does this too, in minutes for some of the expressions here.
    """
    import sympy as sp

    def lowered(power: Any) -> Any:
        return (1 - sp.cos(power.base.args[0]) ** 2) ** (power.exp // 2) * power.base ** (power.exp % 2)

    expression = sp.sympify(expression).rewrite((sp.sinh, sp.cosh, sp.tanh), sp.exp)
    numerator = sp.expand(sp.fraction(sp.together(expression))[0])
    numerator = numerator.replace(
        lambda part: part.is_Pow and isinstance(part.base, sp.sin) and part.exp.is_Integer and part.exp > 1, lowered
    )
    return sp.expand(numerator) == 0


def is_skew(matrix: Any) -> bool:
    """Whether A + A' is zero."""
    return all(vanishes(entry) for entry in matrix + matrix.T)


# --- the decision -------------------------------------------------------------------------------------------


def condition(m1: Any) -> Any:
    """m1 (m1'/m1)', of which the paper's necessary condition is that it is constant, as m1'' - m1'^2/m1."""
    import sympy as sp

    q2 = coordinates()[1]
    return sp.diff(m1, q2, 2) - sp.diff(m1, q2) ** 2 / m1


def explicit_psi(m1: Any, C: Any) -> Any:
    """The Psi of step 3 for an m1 with m1 (m1'/m1)' = C, (2, 2)."""
    import sympy as sp

    q1, q2 = coordinates()
    slope = sp.diff(m1, q2) / m1
    if C.is_zero:
        return sp.Matrix([[1, -q1 * slope / 2], [0, 1]])
    rate = sp.sqrt(abs(C) / 2)
    d = sp.exp(rate * q1) if C.is_positive else sp.cos(rate * q1)
    return sp.Matrix([[1, -sp.diff(d, q1) * slope / C], [0, d]])


@dataclass(frozen=True)
class Decision:
    """Whether M = diag(m1(q2), 1) is PLvCC.

    Attributes:
        plvcc: Whether it is.
        m1: The inertia decided on.
        Psi: One that does it; None if there is none.
        everywhere: Whether Psi has full rank for all q1, at every q2 at which m1 > 0.
        values: m1 (m1'/m1)' by q2: one value if it is constant, two that differ if it is not.
    """

    plvcc: bool
    m1: Any
    Psi: Any
    everywhere: bool
    values: Mapping[Any, Any]


def decide(m1: Any) -> Decision:
    """Decide whether M = diag(m1(q2), 1) is partially linearisable via coordinate changes.

    Args:
        m1: An expression in q2. Other symbols stand for any value that keeps it positive.

    Returns:
        The decision. A yes comes with a Psi, whose B_(i) were found skew-symmetric by substitution in the definition;
        a no with two angles at which m1 (m1'/m1)' is not the same.

    Raises:
        UndecidedError: m1 (m1'/m1)' is not seen to be constant and not seen to change, or the sign of its constant
            depends on a symbol.
    """
    import sympy as sp

    q2 = coordinates()[1]
    value = condition(m1)
    at = {
        angle: sp.factor(value.subs(q2, angle))
        for angle in (sp.Integer(0), sp.pi / 2, sp.pi / 4, sp.Integer(1))
        if not vanishes(m1.subs(q2, angle))
    }
    angle, C = next(iter(at.items()))
    if not vanishes(sp.diff(value, q2)):
        for other, there in at.items():
            difference = sp.factor(there - C)
            if difference.is_zero is False or (difference.free_symbols and not vanishes(difference)):
                return Decision(False, m1, None, False, {angle: C, other: there})
        raise UndecidedError(f"m1 = {m1}: m1 (m1'/m1)' = {value} was not seen to be constant, nor to change")
    if not (C.is_zero or C.is_positive or C.is_negative):
        raise UndecidedError(f"m1 = {m1}: the sign of {C} depends on its symbols; say which of them are positive")
    Psi = explicit_psi(m1, C)
    if not all(is_skew(B(i, Psi, sp.diag(m1, 1))) for i in range(2)):
        raise UndecidedError(f"m1 = {m1}: the B_(i) of Psi = {Psi} were not seen to be skew-symmetric")
    return Decision(True, m1, Psi, not C.is_negative, {angle: C})


# --- the proof ----------------------------------------------------------------------------------------------


def _jet(name: str) -> Any:
    """A function by its value and first derivatives at q = 0, `name + name_1 q1 + name_2 q2`.

    B_(i) holds no higher derivatives, and q = 0 may be any point: what is so for these is so for all functions.
    """
    import sympy as sp

    q1, q2 = coordinates()
    value, first, second = sp.symbols(f"{name} {name}_1 {name}_2")
    return value + first * q1 + second * q2


def _any_psi() -> Any:
    import sympy as sp

    return sp.Matrix([[_jet("a"), _jet("b")], [_jet("c"), _jet("d")]])


def _here() -> dict[Any, int]:
    q1, q2 = coordinates()
    return {q1: 0, q2: 0}


def symmetric_part_is_lie_derivative(i: int, M: Any) -> bool:
    """Step 1 for one column and any Psi, at q = 0."""
    Psi, here = _any_psi(), _here()
    matrix = B(i, Psi, M, here)
    return all(vanishes(entry) for entry in matrix + matrix.T - lie_derivative(Psi[:, i], M).subs(here))


def general_inertia() -> Any:
    """Any symmetric M(q), to first order at q = 0, (2, 2)."""
    import sympy as sp

    return sp.Matrix([[_jet("u"), _jet("v")], [_jet("v"), _jet("w")]])


def papers_inertia() -> Any:
    """diag(m1(q2), 1) with any m1, to first order at q = 0, (2, 2)."""
    import sympy as sp

    return sp.diag(_jet("m").subs(sp.Symbol("m_1"), 0), 1)


def printed_entries() -> dict[str, bool]:
    """Whether the definition gives what the appendix prints for the entries of B_(2), for any Psi and any m1(q2)."""
    import sympy as sp

    found = B(1, _any_psi(), papers_inertia(), _here())
    m, dm, d, b_1, b_2, d_1, d_2 = sp.symbols("m m_2 d b_1 b_2 d_1 d_2")
    printed = {
        "B_(2)22": (found[1, 1], -d_2),
        "B_(2)11": (found[0, 0], (-2 * m * b_1 - d * dm) / (2 * m**2)),
        "B_(2)12 + B_(2)21": (found[0, 1] + found[1, 0], -(d_1 + m * b_2) / m),
    }
    return {name: vanishes(here - there) for name, (here, there) in printed.items()}


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
    """Whether d = 0 with a constant b, the appendix's trivial solution, always leaves a singular Psi (it does not)."""
    import sympy as sp

    q1, q2 = coordinates()
    for m1, Psi in (
        (sp.Integer(1), sp.Matrix([[0, 1], [1, 0]])),
        (sp.exp(2 * q2), sp.Matrix([[-q1, 1], [1, 0]])),
    ):
        if all(is_skew(B(i, Psi, sp.diag(m1, 1))) for i in range(2)) and Psi.det() != 0:
            return False
    return True


def inertia_factor(paper: Paper) -> Any:
    """The factor s in m1 = s (J1 + J2 cos^2 q2)/(I_c + I_d) for which the equations of motion are those of diag(m1, 1).

    With T = (M11 w_b^2 + M22 w_c^2)/2, the gimbal's equation is M22 w_c' - M11' w_b^2/2. In both papers the quotient of
    those terms is (J2/2) sin(2 q_c)/(I_c + I_d), with M11 = n (J1 + J2 cos^2 q_c) for n gimbals.
    """
    import sympy as sp

    n = {"aranovskiy2020": 2, "sokolov2019": 1}[paper]
    J1, J2, rotor, M22, q_c = sp.symbols("J1 J2 rotor M22 q_c", positive=True)
    M11 = n * (J1 + J2 * sp.cos(q_c) ** 2)
    printed = J2 / 2 * sp.sin(2 * q_c) / rotor
    (found,) = sp.solve(sp.Eq(sp.simplify(-sp.diff(M11, q_c) / (2 * M22 * printed)), 1), M22)
    return sp.simplify(M11 / found * rotor / (J1 + J2 * sp.cos(q_c) ** 2))


def printed_factor(paper: Paper) -> int:
    """The factor before (J1 + J2 cos^2 q2)/(I_c + I_d) as printed."""
    return {"aranovskiy2020": 2, "sokolov2019": 1}[paper]


def papers_m1(paper: Paper, numbers: bool = False) -> Any:
    """m1 as printed: with the symbols J1, J2 and I_c + I_d, or with the exact numbers of Table 1 (Table I)."""
    import sympy as sp

    q2 = coordinates()[1]
    J1, rotor = sp.symbols("J1 I_cd", positive=True)
    J2 = sp.Symbol("J2", real=True, nonzero=True)
    m1 = printed_factor(paper) * (J1 + J2 * sp.cos(q2) ** 2) / rotor
    if not numbers:
        return m1
    m, l = sp.Rational("2.62"), sp.Rational("0.19")  # noqa: E741  the paper's name
    arm = {"aranovskiy2020": l**2 / 2, "sokolov2019": sp.Rational("0.13") ** 2}[paper]
    J_b, I_c, J_c, K_c = (sp.Rational(text) / 10**4 for text in ("130", "10", "2.6", "9.9"))
    I_d, J_d = (sp.Rational(text) / 10**4 for text in ("5.6", "11"))
    return m1.subs({J1: I_d + J_b + K_c + m * arm, J2: J_c - I_d + J_d - K_c, rotor: I_c + I_d})


@dataclass(frozen=True)
class Proof:
    """What of a paper's proof was found right.

    Attributes:
        steps: Step in words -> whether it was found so.
        no: The decisions on the paper's m1, with symbols and with the numbers of its table.
        yes: The decisions on inertias that are PLvCC, constant m1 first.
    """

    steps: Mapping[str, bool]
    no: tuple[Decision, Decision]
    yes: tuple[Decision, ...]

    @property
    def holds(self) -> bool:
        """Whether every step was found so, the paper's m1 is not PLvCC, and the checker can say yes."""
        return all(self.steps.values()) and not any(d.plvcc for d in self.no) and all(d.plvcc for d in self.yes)


def proof(paper: Paper) -> Proof:
    """Check the proof, step by step, and the counter-checks."""
    import sympy as sp

    q2 = coordinates()[1]
    A, D, k = sp.symbols("A D k", positive=True)
    family = (A * sp.exp(k * q2) + D * sp.exp(-k * q2)) ** 2
    steps = {f"{name} is as printed": right for name, right in printed_entries().items()}
    for i in range(2):
        steps[f"B_({i + 1}) is skew-symmetric exactly if column {i + 1} is a Killing field"] = (
            symmetric_part_is_lie_derivative(i, papers_inertia())
        )
    steps["the mixed derivatives of b demand m1 (m1'/m1)' d = 2 d''"] = mixed_derivatives()
    f = sp.Function("f")(q2)
    steps["for m1 = f^2, m1 (m1'/m1)' is constant exactly if f''/f is"] = vanishes(
        sp.diff(condition(f**2), q2) - 2 * f**2 * sp.diff(sp.diff(f, q2, 2) / f, q2)
    )
    steps["it is 8 A D k^2 for f = A exp(k q2) + D exp(-k q2)"] = vanishes(condition(family) - 8 * A * D * k**2)
    no = (decide(papers_m1(paper)), decide(papers_m1(paper, numbers=True)))
    J1 = sp.Symbol("J1", positive=True)
    yes = tuple(decide(m1) for m1 in (J1, sp.exp(2 * k * q2), sp.cosh(k * q2) ** 2))
    return Proof(steps, no, yes)


def claim(paper: Paper = "aranovskiy2020") -> Claim:
    """The appendix of aranovskiy2020, or Proposition 1 of sokolov2019, whose proof is not printed there."""
    result = proof(paper)
    symbolic, numeric = result.no
    constant, *others = result.yes
    said = ", ".join(f"{value} at q2 = {angle}" for angle, value in symbolic.values.items())
    gap = not zero_d_is_singular()
    sign = mixed_derivatives() and not mixed_derivatives(sign=-1)
    factor = inertia_factor(paper)
    conditions = []
    if paper == "aranovskiy2020":
        if gap:
            conditions.append(
                "the printed proof has a gap: d = 0 alone does not make Psi singular (m1 = 1, Psi = [[0, 1], [1, 0]]); "
                "the same argument for c, from B_(1), closes it: m1 (m1'/m1)' not constant makes both c and d zero"
            )
        if sign:
            conditions.append(
                "the equality of the mixed derivatives is printed with a wrong sign: it is m1 (m1'/m1)' d = +2 d''"
            )
        if factor != printed_factor(paper):
            conditions.append(
                f"by (2) the factor before (J1 + J2 cos^2 q2)/(I_c + I_d) is {factor}, not {printed_factor(paper)}, "
                "since both gimbals turn; the conclusion is the same for any factor"
            )
    found = (
        f"No such Psi exists: m1 (m1'/m1)' is {said} (I_cd = I_c + I_d), which differ for every J2 other than 0. The "
        f"checker can say yes: constant m1 has Psi = {_text(constant.Psi)}, "
        + ", ".join(f"m1 = {d.m1} has Psi = {_text(d.Psi)}" for d in others)
        + ", their B_(i) skew-symmetric by substitution in the definition. The paper's necessary condition is also "
        "sufficient: a column of Psi serves exactly if it is a Killing field of M, and an m1 > 0 on the whole line has "
        "two independent ones exactly if m1 = (A exp(k q2) + D exp(-k q2))^2 with A, D >= 0"
        + (". The paper prints no proof; this is one." if paper == "sokolov2019" else ".")
    )
    figures = {
        "steps": dict(result.steps),
        "papers_m1": {"m1": str(symbolic.m1), "plvcc": symbolic.plvcc, "condition_by_q2": _plain(symbolic)},
        "table_numbers": {"m1": str(numeric.m1), "plvcc": numeric.plvcc, "condition_by_q2": _plain(numeric)},
        "counter_checks": [
            {"m1": str(d.m1), "plvcc": d.plvcc, "condition_by_q2": _plain(d), "Psi": _text(d.Psi)} for d in result.yes
        ],
        "d_zero_alone_is_singular": not gap,
        "factor_of_m1_by_the_equations": int(factor),
        "factor_of_m1_printed": printed_factor(paper),
    }
    says = (
        "No full-rank Psi(q) makes B_(1) and B_(2) skew-symmetric: the system is not partially linearisable via "
        "coordinate changes."
    )
    why = "; ".join(conditions) if result.holds else _missing(result)
    return Claim(PLACES[paper], says, found, verdict(result.holds, why), why, figures)


def _missing(result: Proof) -> str:
    """Which steps were not found so, for a verdict that says no."""
    wrong = [name for name, right in result.steps.items() if not right]
    wrong += [f"m1 = {d.m1}: a Psi was found" for d in result.no if d.plvcc]
    wrong += [f"m1 = {d.m1}: no Psi was found" for d in result.yes if not d.plvcc]
    return "; ".join(wrong)


def _text(matrix: Any) -> str:
    return "none" if matrix is None else str(matrix.tolist())


def _plain(decision: Decision) -> dict[str, str]:
    return {str(angle): str(value) for angle, value in decision.values.items()}
