"""Wrong reports: one line of cmg_mj/papers changed, and the test that must then fail. Run by tests/mutations.py."""

from __future__ import annotations

from dataclasses import dataclass

PAPERS = "cmg_mj/papers/"
TESTS = "tests/papers/test_"


@dataclass(frozen=True)
class Mutant:
    """A line of a report's code, changed.

    Attributes:
        wrong: What is wrong with it.
        file: Where, in cmg_mj/papers.
        old: A text that stands once in it.
        new: What stands there instead.
        test: The test, in tests/papers, that must fail.
    """

    wrong: str
    file: str
    old: str
    new: str
    test: str

    def apply(self, text: str) -> str:
        """The file's text, changed.

        Raises:
            LookupError: The old text does not stand exactly once.
        """
        if text.count(self.old) != 1:
            raise LookupError(f"{self.wrong}: {self.old!r} stands {text.count(self.old)} times in {self.file}")
        return text.replace(self.old, self.new)


S, D, A = "sokolov2019/", "dao2023/", "andrieu2009/"
LOOP, GAP = "sokolov2019_closed_loop.py::", "sokolov2019_backlash.py::"
EQUATIONS, ANDRIEU, DAO = "andrieu2009_equations.py::", "andrieu2009.py::", "dao2023_verdicts.py::"
R, SECTION_5, CONSTANT = "aranovskiy2020/", "aranovskiy2020_section_5.py::", "aranovskiy2020_time_invariant.py::"
TABLE_2, SERVO, REMARK_1 = "aranovskiy2020_table_2.py::", "aranovskiy2020_servo.py::", "aranovskiy2020_remark_1.py::"
GAINS, EIGHT = "aranovskiy2020_optimality.py::", "aranovskiy2020_hypotheses.py::"
FIGURES_5_TO_7 = SECTION_5 + "test_every_figure_is_of_its_own_runs"
OWN_RUNS = LOOP + "test_every_figure_shows_its_own_observers_runs"

MUTANTS = [
    # --- the report ---
    Mutant("what fails is excused without data missing", "claim.py",
           'return "not reproduced"', 'return "cannot be tested" if self.assumes else "not reproduced"',
           "command.py::test_one_rule_decides"),
    Mutant("a general statement is proved by some systems", "claim.py", "if self.is_general:\n", "if False:\n",
           "command.py::test_one_rule_decides"),
    # --- aranovskiy2020 ---
    Mutant("Figs 5 to 7: runs taken from another observer", R + "section_5.py",
           "return run_loops(cases, worlds, seed, duration_s)",
           'return dict.fromkeys(observers, run_loops(cases, worlds, seed, duration_s)["ltv"])', FIGURES_5_TO_7),
    Mutant("the order: an interval's other end", R + "section_5.py", "interval.low > 0.0", "interval.high > 0.0",
           SECTION_5 + "test_an_order_is_one_beyond_chance_in_both_steps"),
    Mutant("the cause: (11) by Euler left out", R + "section_5.py", "- (errors[ELEVEN_BY_EULER] - errors[ELEVEN])",
           "", SECTION_5 + "test_the_cause_is_partly_the_method"),
    Mutant("(10) by Euler: the flywheel's drag, its sign", R + "forms_of_10.py", "a = -u * damping", "a = u * damping",
           REMARK_1 + "test_ten_by_euler_on_floats_and_arrays_is_the_plain_one"),
    Mutant("gravity's lever, its sign", R + "section_5.py", "l2 - lever if", "l2 + lever if",
           CONSTANT + "test_bias_of_the_rate_at_rest_by_replay"),
    Mutant("Table 2: a line of another observer", R + "table_2.py", "level = experiment.levels[observer]",
           'level = experiment.levels["linear"]', TABLE_2 + "test_two_lines_of_one_experiment"),
    Mutant("tau_c: the sign of the flywheel's term", R + "paper.py", 'inertial_torque + TABLE_1["J_d"] * x2',
           'inertial_torque - TABLE_1["J_d"] * x2',
           "aranovskiy2020_model.py::test_six_bodies_move_as_the_reduced_model_says"),
    Mutant("the yaw of a mismatch, its sign", R + "hypotheses.py", "np.sin(tilt)\n    return (momentum[0] - momentum)",
           "np.sin(tilt)\n    return (momentum - momentum[0])",
           EIGHT + "test_small_mismatch_is_foreseen_from_the_symmetric_rig"),
    # --- sokolov2019 ---
    Mutant("Fig. 4: figures from (9)'s runs", S + "section_5.py", "{**_figures(loops, name, cycles), **figures}",
           '{**_figures(loops, "luenberger", cycles), **figures}', OWN_RUNS),
    Mutant("a difference turned round", S + "section_5.py", "b.values(key) - a.values(key)",
           "a.values(key) - b.values(key)", LOOP + "test_better_is_beyond_chance_and_counts_falls"),
    Mutant("a decaying motion counts as sustained", S + "lag.py", "last >= STEADY * before",
           "last <= before / STEADY", "sokolov2019_lag.py::test_what_counts_as_sustained"),
    Mutant("the flywheel's torque on the gimbal, its sign", S + "lag.py",
           "A[3, [1, 2, 3, 4]] = -h / inertia", "A[3, [1, 2, 3, 4]] = h / inertia",
           "sokolov2019_lag.py::test_pole_of_the_sampled_loop_is_mujocos"),
    Mutant("gravity's lever, its sign", S + "figure_3.py", "return L2 - model.gravity_torque",
           "return L2 + model.gravity_torque",
           "sokolov2019_figure_3.py::test_9_and_its_form_with_y2_are_one_at_small_angles"),
    Mutant("the rest of (9), its sign", S + "paper.py", "@ [-e, 0.0])", "@ [e, 0.0])",
           "sokolov2019_observer_bias.py::test_observers_biases"),
    Mutant("the gimbal's momentum, its sign", S + "bearing.py", "by_spin - inertia * (np.cos(q_b)",
           "by_spin + inertia * (np.cos(q_b)", "sokolov2019_bearing.py::test_momentum_about_the_vertical_is_mujocos"),
    # --- dao2023 ---
    Mutant("what does not settle counts", D + "figures.py",
           "in_order = (thousand < ten) & (ten <= tenth) & np.isfinite(thousand)",
           "in_order = (thousand <= ten) & (ten <= tenth)", DAO + "test_settling_order_needs_both_steps"),
    Mutant("(10) or (14), the other way round", D + "theory.py", "if by_14 < by_10 else",
           "if by_14 > by_10 else", DAO + "test_what_the_observer_finds_decides_what_is_meant"),
    # --- andrieu2009 ---
    Mutant("(19) without the spread of A", A + "theory.py", "(1.0 + spread) * part)", "part)",
           EQUATIONS + "test_19_holds_for_every_a_within_the_spread"),
    Mutant("Fig. 2: in order in any seed", A + "figures.py", "holds=share >= MIN_SEEDS", "holds=share > 0.0",
           ANDRIEU + "test_order_of_figure_2_is_needed_in_nearly_every_seed"),
    Mutant("on the rig: another observer's falls", A + "on_the_rig.py", 'holds=standing_counts["high_gain"] == worlds',
           'holds=standing_counts["linear"] == worlds', ANDRIEU + "test_a_fall_on_the_rig_is_not_hidden"),
]  # fmt: skip
