"""The quick tier: what `pytest -m "not slow"` runs, in less than a minute on two cores. All other tests are slow.

Each room names the files that test it for the least time, and perhaps one function of a file. `SLOW` names the
functions in these files that took long when measured: 0.8 s of the processor or more in all, 0.25 s or more a case
(2026-11-27, Python 3.10). `pytest --durations=0` measures anew. A new test file is slow until it is listed here. CI
runs everything.
"""

__all__ = ["QUICK", "SLOW", "is_quick"]

QUICK = {
    "adapters": ("test_adapters",),
    "annotations": ("test_annotations", "test_vocabulary", "test_rules"),
    "batch": ("test_batch",),
    "boundaries": ("test_laws", "test_rates"),
    "bounds": ("test_bounds", "test_separation_tables", "test_sides"),
    "certificates": ("test_certificates", "test_boxes", "test_bounded_motion", "test_splines", "test_one_angle"),
    "cli": ("test_cli_tables::test_widths_keep_every_word_and_fit", "test_input"),
    "contact": ("test_contact",),
    "coverage": ("test_coverage", "test_bodies", "test_triangles"),
    "crosscheck": ("test_crosscheck::test_mathematics_agrees_on_every_robot_of_the_zoo",),
    "evaluate": ("test_depth", "test_touching"),
    "explorer": ("test_live",),
    "export": ("test_export", "test_half_spaces"),
    "figures": ("test_plots",),
    "freespace": ("test_polytope", "test_held", "test_vertices"),
    "geometry": ("test_gjk", "test_rotations"),
    "kernel": ("test_kernel_choice",),
    "limits": ("test_univariate",),
    "loops": ("test_planar_loops", "test_closures", "test_parallelograms"),
    "machine": ("test_kernel_sincos",),
    "marking": ("test_always", "test_broad", "test_narrow", "test_disabled"),
    "meshes": ("test_meshes",),
    "model": ("test_normalise", "test_coupling"),
    "motion": ("test_motion",),
    "path": ("test_path", "test_shared", "test_several"),
    "region": ("test_region", "test_region_convex", "test_membership"),
    "reproduce": ("test_paper",),
    "robot": ("test_home", "test_presets", "test_moving", "test_axes"),
    "tables": ("test_tables",),
    "": ("test_tiers",),
}
"""Rooms, and the files, or `file::function`, that are quick."""

SLOW = {
    "test_adapters": ("test_pink_meets_no_boundary",),
    "test_always": ("test_the_bound_is_below_the_overlap_at_every_angle",),
    "test_batch": (
        "test_every_column_says_what_the_api_says",
        "test_kill_at_random_moments_changes_nothing",
        "test_made_rows_do_not_depend_on_the_chunks",
        "test_the_command_writes_grid_rows_and_a_summary",
        "test_without_pyarrow_the_extra_is_named",
    ),
    "test_annotations": ("test_save_and_load_give_everything_back_exactly",),
    "test_bodies": ("test_bodies_are_those_of_pinocchio", "test_mutated_geometry_is_refused_or_answered"),
    "test_bounds": (
        "test_enclosures_hold_on_parts_of_motions",
        "test_extremes_of_one_angle",
        "test_lever_arms_hold_and_are_not_far_off",
        "test_rounding_bound_covers_reduction_and_evaluation_and_stays_small",
    ),
    "test_boxes": (
        "test_a_box_without_width_agrees_with_a_motion_that_stands_still",
        "test_a_spent_budget_is_said",
    ),
    "test_certificates": (
        "test_boxes_against_sampling",
        "test_budget_never_certifies_what_is_not_clear",
        "test_functions_with_bounds_of_their_derivatives",
        "test_maximal_box_cannot_grow",
        "test_random_motions_against_dense_sampling",
        "test_splines_against_dense_sampling",
        "test_waypoints_clear_but_not_between",
        "test_what_the_budget_never_reached_is_not_certified",
    ),
    "test_contact": (
        "test_a_changed_minervabot_keeps_its_contact_and_says_what_it_is",
        "test_an_end_that_limits_give_is_allowed_when_asked_again",
        "test_batches_call_what_lies_beyond_a_stop_contact",
        "test_five_questions_never_disagree",
    ),
    "test_coverage": (
        "test_a_union_of_spheres_with_a_hole_holds_nothing",
        "test_what_is_said_to_be_held_is_held",
    ),
    "test_depth": ("test_gradients_are_those_of_differences",),
    "test_export": ("test_c_compiles_strictly_and_says_the_same",),
    "test_half_spaces": ("test_covers_and_polytopes_are_written",),
    "test_held": ("test_what_is_off_a_list_is_clear_all_over_the_box",),
    "test_input": (
        "test_a_floating_base_is_held_at_its_origin",
        "test_annotations_may_be_given_more_than_once",
        "test_the_command_line_says_it_once_and_exits_with_2",
    ),
    "test_kernel_choice": (
        "test_all_answers_run_compiled_once_their_code_is_kept",
        "test_no_sign_depends_on_the_backend",
    ),
    "test_kernel_sincos": ("test_the_neighbours_of_multiples_of_half_pi_stay_below_two_ulp",),
    "test_laws": ("test_symbolic_equals_numeric",),
    "test_live": ("test_a_slider_moves_the_links", "test_the_command_serves_until_ctrl_c"),
    "test_motion": ("test_figure_shows_every_boundary",),
    "test_narrow": ("test_pairs_are_judged_together_as_each_by_its_own_path",),
    "test_normalise": ("test_every_rounding_or_cut_of_a_quarter_turn_is_recognised",),
    "test_plots": (
        "test_names_do_not_cover_each_other_and_edges_without_room_are_in_a_legend",
        "test_regions_robots_and_certificates_draw_themselves_in_axes_that_are_given",
    ),
    "test_polytope": (
        "test_a_seed_close_to_contact_has_a_small_polytope_or_none",
        "test_a_seed_on_a_contact_line_is_not_certified",
        "test_capsules_of_one_angle_are_proven_by_halving",
        "test_several_angles_are_searched_and_proven",
        "test_volume_is_the_regions_area_times_the_range_of_q1",
    ),
    "test_rates": ("test_limits_are_those_of_all_boundaries",),
    "test_region": (
        "test_components_are_those_of_the_flood",
        "test_minervabot_is_exact",
        "test_random_mechanisms_agree_with_brute_force",
    ),
    "test_rules": (
        "test_free_limits_and_regions_follow_the_rules",
        "test_inverse_kinematics_keeps_guarded_rules",
    ),
    "test_separation_tables": (
        "test_along_pieces_the_bounds_are_those_of_numpy_and_hold_all_that_is_sampled",
        "test_certificates_are_the_same_whichever_bounds_them",
        "test_of_many_coordinates_what_other_vertices_cost_is_counted_over_boxes",
        "test_over_boxes_the_bounds_are_those_of_numpy_and_hold_all_that_is_sampled",
    ),
    "test_sides": ("test_the_way_from_home_says_what_the_strips_say",),
    "test_splines": ("test_high_degrees_are_answered",),
    "test_tiers": ("test_pytest_runs_what_the_list_says",),
    "test_univariate": (
        "test_arcs_end_in_contact_on_spatial_robots",
        "test_bodies_that_slide_stop_where_they_meet_however_far_they_may_go",
        "test_bodies_that_turn_stop_where_they_meet",
        "test_limits_of_a_set_agree_one_by_one_and_in_a_table",
        "test_many_equals_one",
        "test_multipliers_of_any_size",
        "test_symbolic_limits_equal_the_numbers",
    ),
}
"""Functions of quick files that took long."""


def is_quick(file: str, function: str) -> bool:
    """Tell whether a test is in the quick tier: `file` without `.py`, `function` without its parameters."""
    named = {name for names in QUICK.values() for name in names}
    return f"{file}::{function}" in named or (file in named and function not in SLOW.get(file, ()))
