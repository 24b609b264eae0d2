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
    Mutant("what holds is listed as not reproduced", "report.py", "if not claim.holds\n", "if claim.holds\n",
           "command.py::test_all_papers_make_one_report"),
    Mutant("a condition is left out as said before at its first place", "sentences.py", "if first_place == place:",
           "if first_place != place:", "sentences.py::test_what_was_said_is_not_said_again"),
    Mutant("a verdict that does not follow", "claim.py", 'if self.conditions else "reproduced"',
           'if self.otherwise else "reproduced"', "command.py::test_the_verdict_follows_from_what_was_found"),
    Mutant("one scale a picture, not one for all", "scales.py", "_range([panel for panel in panels if",
           "_range([panel for panel in panels[:6] if", LOOP + "test_the_three_pictures_share_their_scales"),
    # --- aranovskiy2020 ---
    Mutant("Figs 5 to 7: runs taken from another observer", R + "figures_5_to_7.py",
           "zip(observers, run_side_by_side(runs), strict=True)",
           "zip(observers, run_side_by_side(runs)[1:2] * 3, strict=True)", FIGURES_5_TO_7),
    Mutant("Figs 5 to 7: the other kind of angles", R + "figures_5_to_7.py", "{angles: results[angles][name] for",
           '{angles: results["measured"][name] for', FIGURES_5_TO_7),
    Mutant("Figs 5 to 7: settling does not count", R + "figures_5_to_7.py", "min(settles.values()) == 1.0",
           "min(settles.values()) >= 0.0",
           SECTION_5 + "test_a_world_that_falls_is_seen_and_left_out_of_the_mean"),
    Mutant("the cause: (10) from (11)'s runs", R + "figures_5_to_7.py", 'second_place.TEN: results["measured"]["ltv"]',
           'second_place.TEN: results["measured"]["homogeneous"]', FIGURES_5_TO_7),
    Mutant("the order: an interval's other end", R + "comparison.py", "step.low > 0.0", "step.high > 0.0",
           SECTION_5 + "test_an_order_is_one_beyond_chance_in_both_steps"),
    Mutant("the inverted order: an interval's other end", R + "comparison.py", "step.high < 0.0", "step.low < 0.0",
           SECTION_5 + "test_an_order_is_one_beyond_chance_in_both_steps"),
    Mutant("the order: a difference turned round", R + "comparison.py", "numbers[worse] - numbers[better]",
           "numbers[better] - numbers[worse]", SECTION_5 + "test_an_order_is_one_beyond_chance_in_both_steps"),
    Mutant("the order: one kind of angles will do", R + "comparison.py",
           "return set(self.orders.values()) == {order}",
           "return order in self.orders.values()",
           SECTION_5 + "test_the_order_is_judged_by_the_velocity_on_all_angles"),
    Mutant("the order: judged by another measure", R + "comparison.py", "if measure.key == JUDGED",
           "if measure.key != JUDGED", SECTION_5 + "test_the_order_is_judged_by_the_velocity_on_all_angles"),
    Mutant("the cause: an interval's other end", R + "second_place.py", "interval.low > 0.0", "interval.high > 0.0",
           SECTION_5 + "test_the_cause_is_not_partly_the_method"),
    Mutant("the cause: all of it will do", R + "second_place.py", "_positive(method) and _positive(exact)",
           "_positive(method)", SECTION_5 + "test_the_cause_is_not_partly_the_method"),
    Mutant("the cause: (11) by Euler left out", R + "second_place.py", "- (errors[ELEVEN_BY_EULER] - errors[ELEVEN])",
           "", SECTION_5 + "test_the_cause_is_partly_the_method"),
    Mutant("Fig. 4: judged by the whole run", R + "figure_4.py", "holds=spread_after < COMPARABLE",
           "holds=spread < COMPARABLE", SECTION_5 + "test_figure_4_is_judged_by_the_push"),
    Mutant("Fig. 4: zero's error turned round", R + "figure_4.py", 'errors[name].mean > errors["zero"].mean',
           'errors[name].mean < errors["zero"].mean', SECTION_5 + "test_figure_4_is_judged_by_the_push"),
    Mutant("(10) by Euler: the flywheel's drag, its sign", R + "by_euler.py", "a = -u * damping", "a = u * damping",
           REMARK_1 + "test_ten_by_euler_on_floats_and_arrays_is_the_plain_one"),
    Mutant("(11) by Euler: the drag, its sign", R + "by_euler.py", "gain - damping * x2", "gain + damping * x2",
           REMARK_1 + "test_eleven_by_euler_approaches_the_benchs"),
    Mutant("the frozen gain: of the law's model", R + "time_invariant.py", "if model == LINEAR:\n",
           "if model != LINEAR:\n", CONSTANT + "test_bias_of_the_rate_at_rest_by_replay"),
    Mutant("gravity's lever, its sign", R + "time_invariant.py", "l2 - lever if", "l2 + lever if",
           CONSTANT + "test_bias_of_the_rate_at_rest_by_replay"),
    Mutant("the remark: any gain will do", R + "time_invariant.py", "if c[0] in PRINTED and self", "if self",
           CONSTANT + "test_it_is_not_reproduced_where"),
    Mutant("the remark: (10) may fall as well", R + "time_invariant.py", "if self.whole[JUDGED_DEG].fell > 0.0:",
           "if self.whole[JUDGED_DEG].fell > 1.0:", CONSTANT + "test_it_is_not_reproduced_where"),
    Mutant("the joint experiment: zero is not asked", R + "joint.py",
           "[case for case in candidates if case.beats_zero] or candidates", "candidates",
           TABLE_2 + "test_the_joint_experiment_is_the_one_whose_worst_loses_least"),
    Mutant("the joint experiment: the best of three", R + "joint.py", "return max(level.ratio.mean for",
           "return min(level.ratio.mean for", TABLE_2 + "test_the_joint_experiment_is_the_one_whose_worst_loses_least"),
    Mutant("Table 2: a line of another observer", R + "table_2.py", "level = experiment.levels[case.observer]",
           'level = experiment.levels["linear"]', TABLE_2 + "test_two_lines_of_one_experiment"),
    Mutant("Table 2: best where zero is better", R + "table_2.py", "holds=is_best(level) and is_tunable",
           "holds=is_best(level)", TABLE_2 + "test_nothing_is_tuned_where_zero_is_closer"),
    Mutant("Table 2 together: best where zero is better", R + "joint.py", "holds=nearest.beats_zero and not misfits",
           "holds=not misfits", TABLE_2 + "test_nothing_is_tuned_where_zero_is_closer"),
    Mutant("the tuning: an interval's other end", R + "tuning_procedure.py", "if not ratio.high >= 1.0",
           "if not ratio.low >= 1.0", TABLE_2 + "test_a_fit_to_the_gyro_need_not_be_one_for_the_loop"),
    Mutant("the loop: given and tuned exchanged", R + "retuned.py", "for settings in ([], tuned_settings)",
           "for settings in (tuned_settings, [])", TABLE_2 + "test_the_tuned_are_set_in_the_loop"),
    Mutant("K_e: rounding of other digits", R + "optimality.py", "- K) / rounding).max()", "- K) * rounding).max()",
           GAINS + "test_to_more_digits_no_diagonal_cost_gives_them"),
    Mutant("the misprint matters and is harmless", R + "misprint.py", "rate.difference < HARMLESS * rate.error",
           "rate.error > 0.0", REMARK_1 + "test_the_misprint_is_one_that_does_not_matter"),
    Mutant("tau_c: the sign of the flywheel's term", R + "paper.py", 'inertial_torque + TABLE_1["J_d"] * x2',
           'inertial_torque - TABLE_1["J_d"] * x2',
           "aranovskiy2020_model.py::test_six_bodies_move_as_the_reduced_model_says"),
    Mutant("a deadband half as wide", R + "servo.py", "= kv * deadband", "= 0.5 * kv * deadband",
           SERVO + "test_a_gimbal_with_a_deadband_of_a_tenth"),
    Mutant("a servo that is noticed", R + "servo.py", "holds=RESOLUTION in harmless and", "holds=",
           SERVO + "test_a_servo_that_is_noticed_is_not_reproduced"),
    Mutant("one gimbal of a pair the wrong way", R + "two_axes.py", "M[tilt, wheel] * data.qvel[wheel]",
           "M[tilt, wheel]", SERVO + "test_a_command_tilts_its_own_axis_as_the_reduced_model_says"),
    Mutant("finite time with any exponent", R + "finite_time.py", "f2 / alpha\n", "f2\n",
           "aranovskiy2020_differentiators.py::test_the_error_is_gone_in_finite_time"),
    Mutant("the yaw of a mismatch, its sign", R + "yaw_momentum.py", "return (momentum[0] - momentum) / parts.yaw",
           "return (momentum - momentum[0]) / parts.yaw",
           EIGHT + "test_small_mismatch_is_foreseen_from_the_symmetric_rig"),
    Mutant("the rest of (8), its sign", R + "paper.py", "return k1 / k4 * e", "return -k1 / k4 * e",
           "aranovskiy2020_model.py::test_equilibria_by_integrating_the_nonlinear_model"),
    Mutant("a rest of the other sign will do", R + "rest.py", "abs(self.x_e.mean / expected_x_e - 1.0)",
           "abs(abs(self.x_e.mean / expected_x_e) - 1.0)",
           "aranovskiy2020_rest.py::test_the_rig_rests_at_zero_with_a_biased_observer"),
    # --- sokolov2019 ---
    Mutant("Fig. 4: figures from (9)'s runs", S + "figures_4_to_6.py", '_figures(loops, "linear", cycles)',
           '_figures(loops, "luenberger", cycles)', OWN_RUNS),
    Mutant("Fig. 5: figures from (8)'s runs", S + "figures_4_to_6.py", '_figures(loops, "luenberger", cycles)',
           '_figures(loops, "linear", cycles)', OWN_RUNS),
    Mutant("Fig. 6: figures from (9)'s runs", S + "figures_4_to_6.py", '_figures(loops, "homogeneous", cycles)',
           '_figures(loops, "luenberger", cycles)', OWN_RUNS),
    Mutant("Fig. 5: the picture of (8)", S + "figures_4_to_6.py", 'picture("luenberger", loops)',
           'picture("linear", loops)', OWN_RUNS),
    Mutant("Figs 4 to 6: with and without backlash exchanged", S + "figures_4_to_6.py",
           "no_gap, gap, cycle = loops.by_bias[SHOWN_DEG][name], loops.gap[name]",
           "gap, no_gap, cycle = loops.by_bias[SHOWN_DEG][name], loops.gap[name]", OWN_RUNS),
    Mutant("Fig. 6: the gyro's runs in the picture", S + "pictures_4_to_6.py", "loops.by_bias[SHOWN_DEG][name]",
           "loops.gyro", OWN_RUNS),
    Mutant("Fig. 6: falls at one setting only", S + "figures_4_to_6.py", "holds=max(falls.values()) == 0.0",
           "holds=min(falls.values()) == 0.0", LOOP + "test_figure_6_with_a_fall"),
    Mutant("Fig. 6: at rest where nothing oscillates counts", S + "figures_4_to_6.py",
           "(eight.sustained or nine.sustained) and not", "not", LOOP + "test_verdicts_follow_the_lags_and_the_cycles"),
    Mutant("the cause of Fig. 5: any smaller amplitude will do", S + "figures_4_to_6.py",
           "< 0.5 * without_y2.amplitude_deg",
           "< 0.7 * without_y2.amplitude_deg", LOOP + "test_verdicts_follow_the_lags_and_the_cycles"),
    Mutant("the runs without backlash have it", S + "loops.py", "[*[0.0] * len(BIASES_DEG), GAP_ARCMIN]",
           "[*[GAP_ARCMIN] * len(BIASES_DEG), 0.0]", LOOP + "test_only_the_runs_behind_a_gap_have_one"),
    Mutant("the late window is the whole run", S + "loops.py", "t >= t[-1] - LATE_S", "t >= t[0]",
           LOOP + "test_the_late_window_does_not_hold_the_pushs_tail"),
    Mutant("a difference's other end", S + "loops.py", "difference.low > 0.0", "difference.high > 0.0",
           LOOP + "test_smaller_is_beyond_chance_and_world_by_world"),
    Mutant("a difference turned round", S + "loops.py", "b.values(key) - a.values(key)",
           "a.values(key) - b.values(key)", LOOP + "test_smaller_is_beyond_chance_and_world_by_world"),
    Mutant("better although it falls itself", S + "loops.py", "a.stood.all() and b.fell.all()", "b.fell.all()",
           LOOP + "test_better_counts_falls"),
    Mutant("better although it falls more often", S + "loops.py",
           "return beyond_chance and a.fell.mean() <= b.fell.mean()", "return beyond_chance",
           LOOP + "test_better_counts_falls"),
    Mutant("Section VI without its first half", S + "comparison.py", "return with_model and nonlinear",
           "return nonlinear", LOOP + "test_section_6_needs_both_steps_and_no_fall"),
    Mutant("Section VI without its second half", S + "comparison.py", "return with_model and nonlinear",
           "return with_model", LOOP + "test_section_6_needs_both_steps_and_no_fall"),
    Mutant("Section V: the best in one setting will do", S + "comparison.py", "holds=all(wins.values())",
           "holds=any(wins.values())", LOOP + "test_verdict_of_the_comparison_follows_the_errors"),
    Mutant("a gap twice as wide", "../controllers/backlash.py", "half = self._gap / 2.0", "half = self._gap",
           GAP + "test_share_is_the_fundamental_of_what_a_gap_passes"),
    Mutant("a gap that leads", S + "gap_prediction.py", "-root * root / math.pi", "root * root / math.pi",
           GAP + "test_share_is_the_fundamental_of_what_a_gap_passes"),
    Mutant("a decaying motion counts as sustained", S + "release.py", "last >= STEADY * before",
           "last <= before / STEADY", "sokolov2019_lag.py::test_what_counts_as_sustained"),
    Mutant("the flywheel's torque on the gimbal, its sign", S + "sampled_loop.py",
           "A[3, [1, 2, 3, 4]] = -h / inertia", "A[3, [1, 2, 3, 4]] = h / inertia",
           "sokolov2019_lag.py::test_pole_of_the_sampled_loop_is_mujocos"),
    Mutant("Fig. 3: an interval's other end", S + "figure_3.py", 'holds=relative["luenberger"].low >',
           'holds=relative["luenberger"].high >', "sokolov2019_figure_3.py::test_a_failure_must_be_beyond_chance"),
    Mutant("Fig. 3: the others' other ends", S + "figure_3.py", "max(1.0, *(error.high for",
           "max(1.0, *(error.low for", "sokolov2019_figure_3.py::test_a_failure_must_be_beyond_chance"),
    Mutant("(9) and y2: an interval's other end", S + "figure_3.py", "with_y2.high < 1.0", "with_y2.low < 1.0",
           "sokolov2019_figure_3.py::test_with_y2_it_must_be_better_than_zero_beyond_chance"),
    Mutant("the push's part in (9)'s error, its sign", S + "figure_3.py", "return -lsim(", "return lsim(",
           "sokolov2019_figure_3.py::test_the_push_explains_the_error_of_9"),
    Mutant("gravity's lever, its sign", S + "figure_3.py", "return L2 - model.gravity_torque",
           "return L2 + model.gravity_torque",
           "sokolov2019_figure_3.py::test_9_and_its_form_with_y2_are_one_at_small_angles"),
    Mutant("where the gimbal rests, its sign", S + "equations.py", "x3, x_e = K[0] / K[2]", "x3, x_e = -K[0] / K[2]",
           "sokolov2019_equations.py::test_signs_of_the_equilibria_on_the_nonlinear_model"),
    Mutant("the rest of (9), its sign", S + "paper.py", "@ [-e, 0.0])", "@ [e, 0.0])",
           "sokolov2019_observer_bias.py::test_observers_biases"),
    Mutant("the rest of (10), its sign", S + "paper.py", "model.terms(-e, 0.0)", "model.terms(e, 0.0)",
           "sokolov2019_observer_bias.py::test_observers_biases"),
    Mutant("the gimbal's momentum, its sign", S + "vertical_torque.py", "spin - np.sin(q_b) * inertia * w_c",
           "spin + np.sin(q_b) * inertia * w_c", "sokolov2019_bearing.py::test_momentum_about_the_vertical_is_mujocos"),
    Mutant("Table II: one observer that is not beaten will do", S + "table_2.py",
           'return all(level.verdict != "better"', 'return any(level.verdict != "better"',
           "sokolov2019_table_2.py::test_the_printed_values_must_be_best_on_one_recording"),
    Mutant("the lag: (8) need not be the first", S + "lag.py", "begin.high < least",
           "begin.high > 0.0",
           "sokolov2019_lag.py::test_claim_of_the_lag"),
    # --- dao2023 ---
    Mutant("the conclusion without its second half", D + "figure_3.py",
           "medians[1000.0] < medians[10.0] <= medians[0.1]", "medians[1000.0] < medians[10.0]",
           DAO + "test_conclusion_holds_for_the_weights_tested"),
    Mutant("the conclusion holds beyond as well", D + "figure_3.py", "UNSTATED if order_goes_on else",
           "UNSTATED if in_order else", DAO + "test_conclusion_holds_for_the_weights_tested"),
    Mutant("the settling order without its second half", D + "figure_3.py", "(thousand < ten) & (ten <= tenth)",
           "(thousand < ten)", DAO + "test_settling_order_needs_both_steps"),
    Mutant("what does not settle counts", D + "figure_3.py",
           "in_order = (thousand < ten) & (ten <= tenth) & np.isfinite(thousand)",
           "in_order = (thousand <= ten) & (ten <= tenth)", DAO + "test_settling_order_needs_both_steps"),
    Mutant("Fig. 2(b): the conventional observer need not be worse", D + "figure_2.py",
           "rms.max() < 0.1 and bool((rms < plain).all())", "rms.max() < 0.1", DAO + "test_figure_2"),
    Mutant("Fig. 2(b): of another weight", D + "figure_2.py", "rms, plain = study.proposed.tail_rms()[0]",
           "rms, plain = study.proposed.tail_rms()[1]", DAO + "test_figure_2_is_that_of_the_first_weight"),
    Mutant("Fig. 2(b), how fast: of another weight", D + "figure_2.py", "np.linalg.norm(errors.state[:, 0]",
           "np.linalg.norm(errors.state[:, 1]", DAO + "test_figure_2_is_that_of_the_first_weight"),
    Mutant("Fig. 3(b): in the mean", D + "figure_3.py", "holds=errors.max() < 1e-3", "holds=errors.mean() < 1e-3",
           DAO + "test_parameters_at_the_end"),
    Mutant("(10) or (14), the other way round", D + "as_printed.py", "rearranged=bool(by_14 < by_10)",
           "rearranged=bool(by_14 > by_10)", DAO + "test_what_the_observer_finds_decides_what_is_meant"),
    Mutant("a blow-up is required", D + "as_printed.py", "holds=bool(rms.max() < 0.1)",
           "holds=bool(rms.max() < 0.1) and math.isfinite(escape)",
           DAO + "test_an_explicit_step_that_stays_bounded_changes_no_verdict"),
    # --- andrieu2009 ---
    Mutant("W's gradient, its sign", A + "lyapunov.py", "by_s2 = -self.h_slope", "by_s2 = self.h_slope",
           EQUATIONS + "test_w_is_its_integral_and_the_gradient_its_derivative"),
    Mutant("W's second degree", A + "lyapunov.py", "self.d_W / r1 - 1.0", "self.d_W - 1.0",
           EQUATIONS + "test_w_is_homogeneous_in_the_bi_limit"),
    Mutant("(19) without the spread of A", A + "lyapunov.py", "(1.0 + spread) * part)", "part)",
           EQUATIONS + "test_19_holds_for_every_a_within_the_spread"),
    Mutant("(20) without b", A + "lyapunov.py", "by_e2 * (1.0 + b) * e2", "by_e2 * (2.0 + b) * e2",
           EQUATIONS + "test_20_with_a_b_of_its_own"),
    Mutant("(11): shrinking under one disturbance will do", A + "equations_11_12.py", "for row in balls for a, b",
           "for row in balls[:1] for a, b", EQUATIONS + "test_11_and_12_can_fail"),
    Mutant("(12): L(0) need not be forgotten", A + "equations_11_12.py", "np.ptp(from_gains) / from_gains[0])", "0.0)",
           EQUATIONS + "test_11_and_12_can_fail"),
    Mutant("(6): the exponents exchanged", A + "increments.py",
           "quotient_of_6(exponent_of_section_2_1(2, 2, 2, p), p, sizes[-1])",
           "quotient_of_6(printed_exponent(2, 2, 2, p), p, sizes[-1])", EQUATIONS + "test_exponent_of_6"),
    Mutant("Fig. 2: in order in any seed", A + "figure_2.py", "holds=share >= LEAST_SEEDS", "holds=share > 0.0",
           ANDRIEU + "test_order_of_figure_2_is_needed_in_nearly_every_seed"),
    Mutant("the bias's cause: the quotient turned round", A + "figure_2.py",
           "biases(study.run, study.exact) / biases(study.run, study.nominal)",
           "biases(study.run, study.nominal) / biases(study.run, study.exact)",
           ANDRIEU + "test_cause_of_a_bias_is_judged_by_what_is_left_without_it"),
    Mutant("the bias's cause: of another observer", A + "figure_2.py", "shares_left = bias_left(study)[0]",
           "shares_left = bias_left(study)[1]", ANDRIEU + "test_cause_of_a_bias_is_judged_by_what_is_left_without_it"),
    Mutant("the scatter: an order in all twelve will do", A + "figure_2.py", "in_window >= STRONG and overall > 0.0",
           "overall > -1.0", ANDRIEU + "test_spread_must_go_with_the_rate"),
    Mutant("on the rig: an interval's other end", A + "on_the_rig.py", '"larger" if difference.low > 0.0',
           '"larger" if difference.high > 0.0', ANDRIEU + "test_differences_on_the_rig_are_beyond_chance"),
    Mutant("on the rig: a difference turned round", A + "on_the_rig.py",
           'known_interval(errors["high_gain"] - errors[label])', 'known_interval(errors[label] - errors["high_gain"])',
           ANDRIEU + "test_differences_on_the_rig_are_beyond_chance"),
    Mutant("on the rig: another observer's falls", A + "on_the_rig.py", 'holds=standing_counts["high_gain"] == worlds',
           'holds=standing_counts["linear"] == worlds', ANDRIEU + "test_a_fall_on_the_rig_is_not_hidden"),
]  # fmt: skip
