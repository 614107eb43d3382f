"""The list of what goes wrong with logs, options, models and files: which tests show that each row is survived.

Tests in this folder carry their row in their name, `test_row_21_...`. Those that stand with the part that they
test are named here. `test_rows.py` checks that no row is without a test and that every test named is there.
"""

from __future__ import annotations

# Row by number, and what goes wrong.
ROWS = {
    1: "a path that does not exist, is a folder, or may not be read",
    2: "an empty file",
    3: "a wrong extension",
    4: "zeros or random bytes",
    5: "a file cut in the middle",
    6: "a header alone, or a part of it",
    7: "one flipped bit (Parquet)",
    14: "an unknown compression (Parquet)",
    19: "CSV with other separators, decimal commas, marks, encodings, headers, line ends",
    20: "cells that are no number, or too large a one",
    21: "column names that are missing, occur twice or carry a unit",
    22: "a log larger than the memory",
    23: "a file that changes or disappears while it is read",
    24: "names with control characters, slashes, blanks or HTML in them",
    26: "time stamps that are no number",
    27: "equal time stamps",
    28: "time stamps out of order",
    32: "gaps",
    35: "time in another unit",
    37: "fewer than three samples, or no duration",
    40: "missing samples",
    41: "a frozen sensor",
    42: "thrusters at neutral throughout",
    43: "an actuator at its limit",
    44: "a heading that wraps",
    45: "degrees for radians, radians for degrees",
    46: "one frame declared as another",
    47: "quaternions that are no rotation, or in another order",
    59: "spikes",
    63: "different vehicles in one data set",
    64: "the same dive fitted and held out",
    65: "an unknown or misspelt key",
    66: "a value of the wrong type or out of range",
    67: "a required value that is missing",
    68: "options that contradict each other",
    69: "YAML that would exhaust the machine",
    70: "code in a configuration",
    71: "environment variables and paths that lead elsewhere",
    72: "an output folder that is not empty",
    79: "an inertia that is not symmetric or not positive definite",
    80: "added mass of the wrong sign",
    81: "damping that adds energy",
    82: "a centre of buoyancy below the centre of gravity",
    85: "an integration that diverges",
    88: "parameters that cannot be told apart",
    89: "a parameter that ends at its bound",
    90: "a fit that explodes or stands still",
    91: "nothing missing",
    92: "two effects that look the same",
    93: "an effect that helps in the fit and not on what was held out",
    97: "a checkpoint or model that is cut or changed",
    98: "foreign pickles and archives",
    99: "a checkpoint or model of another version, or with other tensors",
    100: "weights that are no numbers",
    101: "a kill while saving",
    102: "a training resumed with other data or options",
    103: "reports of hostile names, very many points, or missing parts",
    106: "messages that are late, repeated, out of order or not numbers, while it adapts",
    107: "no excitation while it adapts",
    108: "a sensor fault that looks like a missing effect",
    109: "parameters that jump or diverge",
    110: "an update that makes the prediction worse",
    111: "an update that takes too long",
    112: "power lost while the state is written",
}

_CSV, _PARQUET = "tests/logs/test_logs_csv.py", "tests/logs/test_logs_parquet.py"
_ONLINE = "tests/online/test_online_faults.py"
_PAGES = "tests/report/test_report_pages.py"
_ADD, _DIAGNOSE = "tests/diagnosis/test_diagnosis_add.py", "tests/diagnosis/test_diagnosis_diagnose.py"
_RESUME, _GRADIENT = "tests/training/test_resume.py", "tests/training/test_gradient_schemes.py"
_SAVING, _FOLDERS = "tests/models/test_saving.py", "tests/storage/test_storage_folders.py"
_VEHICLE = "tests/vehicle/test_vehicle_refusals.py::test_refusal_names_file_field_value_and_cure"

# Tests that stand elsewhere, by row.
ELSEWHERE = {
    1: [
        f"{_CSV}::test_paths_that_are_no_file",
        "tests/cli/test_bad_input.py::test_a_missing_file_is_named_with_its_neighbour",
    ],
    3: [f"{_CSV}::test_parquet_under_a_csv_name_is_detected"],
    4: [
        f"{_CSV}::test_what_is_no_table_is_refused",
        f"{_PARQUET}::test_truncated_and_garbled_files",
    ],
    5: [
        f"{_CSV}::test_a_cut_last_row_is_dropped_and_counted",
        f"{_PARQUET}::test_truncated_and_garbled_files",
    ],
    7: [
        f"{_PARQUET}::test_a_flipped_bit_in_our_own_file_is_seen",
        "tests/logs/test_logs_parquet_pages.py::test_every_single_byte_of_the_footer_may_be_damaged",
    ],
    19: [f"{_CSV}::test_dialects", f"{_CSV}::test_utf_16_and_latin_1"],
    20: [f"{_CSV}::test_missing_cells", f"{_CSV}::test_overflow_is_refused_with_its_line"],
    21: ["tests/logs/test_logs_mapping.py::test_missing_columns_come_with_a_mapping_to_copy"],
    22: [f"{_PARQUET}::test_a_footer_that_promises_too_much_memory_is_refused"],
    24: ["tests/cli/test_runs.py::test_any_file_name_works"],
    28: ["tests/logs/test_logs_clock.py::test_any_stamps_give_order_or_a_reason"],
    42: [
        f"{_ADD}::test_thrusters_at_neutral_say_nothing_about_thrusters",
        f"{_DIAGNOSE}::test_thrusters_at_neutral_say_nothing_about_thrusters_and_no_number_pretends_they_do",
    ],
    46: ["tests/logs/test_logs_kinematics.py::test_each_reversed_sign_is_found_alone"],
    47: ["tests/logs/test_logs_kinematics.py::test_quaternion_order"],
    59: ["tests/logs/test_logs_quality.py::test_real_motion_is_no_spike"],
    64: ["tests/logs/test_logs_overlap.py::test_overlapping_windows_are_refused"],
    65: ["tests/cli/test_bad_input.py::test_a_misspelt_word_gets_the_nearest_names"],
    66: [_VEHICLE],
    69: ["tests/cli/test_bad_input.py::test_a_config_that_would_exhaust_the_machine_is_refused"],
    70: ["tests/cli/test_bad_input.py::test_code_in_a_folder_of_configs_is_refused"],
    71: ["tests/storage/test_storage_manifest.py::test_names_that_lead_elsewhere"],
    72: ["tests/cli/test_folder.py::test_a_run_that_fails_leaves_the_folder_as_it_was"],
    79: [_VEHICLE],
    80: [_VEHICLE],
    81: [
        "tests/training/test_levenberg_marquardt.py::test_damping_that_adds_energy_is_said_with_its_place",
        "tests/training/test_levenberg_marquardt.py::test_dissipative_learns_a_dissipative_law_and_nothing_warns",
    ],
    82: ["tests/vehicle/test_vehicle_reading.py::test_what_is_unlikely_is_warned_about"],
    85: ["tests/models/test_rollout.py::test_a_run_with_damping_that_feeds_energy_says_when_and_which_term"],
    88: [
        f"{_ADD}::test_parameters_that_cannot_be_told_apart_are_named",
        "tests/training/test_levenberg_marquardt.py::test_what_the_data_cannot_tell_apart_is_said",
        "tests/diagnosis/test_diagnosis_score.py::test_what_the_log_says_nothing_about_has_no_p_value_below_one_and_no_standard_error",
    ],
    89: [f"{_ADD}::test_a_parameter_that_ends_at_its_bound_is_reported"],
    90: [
        f"{_GRADIENT}::test_an_exploding_fit_retreats_stops_with_a_reason_and_keeps_finite_weights",
        f"{_GRADIENT}::test_one_loss_that_is_not_finite_costs_one_epoch",
        f"{_GRADIENT}::test_a_plateau_ends_the_fit",
    ],
    91: [f"{_DIAGNOSE}::test_nothing_hidden_is_adequate"],
    92: [f"{_DIAGNOSE}::test_two_names_for_the_same_thing_are_given_as_a_group"],
    93: [f"{_ADD}::test_a_model_on_which_nothing_is_missing_gains_nothing_by_an_effect"],
    97: [
        f"{_RESUME}::test_a_damaged_checkpoint_gives_way_to_the_one_before",
        f"{_RESUME}::test_no_intact_checkpoint_is_an_error_that_names_each",
    ],
    98: [f"{_FOLDERS}::test_a_foreign_file_in_place_of_a_folder"],
    99: [
        f"{_RESUME}::test_missing_tensors_are_listed",
        f"{_RESUME}::test_a_checkpoint_of_a_newer_auvnn_is_refused",
    ],
    100: [f"{_SAVING}::test_weights_that_are_not_finite_are_not_saved"],
    101: [
        f"{_FOLDERS}::test_interrupted_anywhere_the_old_folder_is_intact",
        f"{_RESUME}::test_a_process_that_is_really_killed_resumes_to_the_same_bits",
    ],
    102: [
        f"{_RESUME}::test_resuming_with_something_changed_is_refused_with_the_difference",
        f"{_RESUME}::test_a_change_can_be_forced_where_the_shapes_allow_it",
    ],
    103: [
        f"{_PAGES}::test_names_from_a_log_stay_text",
        f"{_PAGES}::test_a_million_samples_are_drawn_within_ten_seconds",
        f"{_PAGES}::test_whatever_is_missing_costs_only_its_own_place",
        f"{_PAGES}::test_a_figure_that_cannot_be_rendered_leaves_a_note",
    ],
    106: [
        f"{_ONLINE}::test_row_106_bad_messages_hold_the_model_and_are_counted",
        f"{_ONLINE}::test_row_106_a_gap_is_not_bridged_by_an_increment",
    ],
    107: [
        f"{_ONLINE}::test_row_107_an_hour_at_rest_moves_nothing",
        f"{_ONLINE}::test_row_107_forgetting_does_not_wind_up",
    ],
    108: [
        f"{_ONLINE}::test_row_108_a_spike_is_not_learned_and_a_lasting_change_is",
        f"{_ONLINE}::test_row_108_a_gyro_that_contradicts_the_attitude_is_not_learned",
        f"{_ONLINE}::test_row_108_a_flagged_fault_switches_adaptation_off_for_a_while",
    ],
    109: [
        f"{_ONLINE}::test_row_109_wild_proposals_never_leave_the_set",
        f"{_ONLINE}::test_row_109_drag_never_begins_to_add_energy",
    ],
    110: [
        f"{_ONLINE}::test_row_110_an_update_that_makes_the_prediction_worse_is_taken_back",
        f"{_ONLINE}::test_row_110_a_good_update_is_validated",
    ],
    111: [
        f"{_ONLINE}::test_row_111_overruns_are_paid_back_by_skipping",
        f"{_ONLINE}::test_row_111_memory_does_not_grow",
    ],
    112: [
        f"{_ONLINE}::test_row_112_power_loss_leaves_the_old_state",
        f"{_ONLINE}::test_row_112_a_damaged_state_is_refused",
        f"{_ONLINE}::test_row_112_a_restart_may_begin_from_the_validated_weights",
    ],
}
