"""The list of what goes wrong with logs, options, models and files: which tests show that each row is survived.

Tests in this folder carry their row in their name, `test_row_21_...`. Those that stand with the part that they
test are named here. `test_rows.py` checks that no row is without a test and that every test named is there.
"""

from __future__ import annotations

import re
from pathlib import Path

# Row by number, and what goes wrong.
ROWS = {
    1: "a path that does not exist, is a folder, or may not be read",
    2: "an empty file",
    3: "a wrong extension",
    4: "zeros or random bytes",
    5: "a file cut in the middle",
    6: "a header alone, or a part of it",
    7: "one flipped bit (Parquet)",
    8: "a block of zeros in a DataFlash log",
    9: "a DataFlash log without its beginning",
    10: "a DataFlash format that is unknown or described twice",
    11: "a reboot inside one file",
    12: "an MCAP file without its end",
    13: "a ROS 2 bag with a missing part",
    14: "an unknown compression (Parquet)",
    15: "a record that claims gigabytes",
    16: "a block that unpacks to gigabytes",
    17: "an archive in the place of a log",
    18: "a MATLAB timetable or object",
    19: "CSV with other separators, decimal commas, marks, encodings, headers, line ends",
    20: "cells that are no number, or too large a one",
    21: "column names that are missing, occur twice or carry a unit",
    22: "a log larger than the memory",
    23: "a file that changes or disappears while it is read",
    24: "names with control characters, slashes, blanks or HTML in them",
    25: "an index beside an IMC log",
    26: "time stamps that are no number",
    27: "equal time stamps",
    28: "time stamps out of order",
    29: "a clock that is set",
    30: "stamps of 0 before the clock starts",
    31: "a counter that wraps",
    32: "gaps",
    33: "sensors with different clocks",
    34: "a sensor that is late",
    35: "time in another unit",
    36: "uneven steps",
    37: "fewer than three samples, or no duration",
    38: "dates in 32-bit numbers",
    39: "dates as text",
    40: "missing samples",
    41: "a frozen sensor",
    42: "thrusters at neutral throughout",
    43: "an actuator at its limit",
    44: "a heading that wraps",
    45: "degrees for radians, radians for degrees",
    46: "one frame declared as another",
    47: "quaternions that are no rotation, or in another order",
    48: "a pitch through the vertical",
    49: "an estimate that is reset",
    50: "another core of the estimator in use",
    51: "a Doppler velocity without bottom lock",
    52: "a depth sensor inside the hull",
    53: "negative depths and heights that mean none",
    54: "a pressure in another unit",
    55: "pulse widths that mean no signal",
    56: "thrusters reversed or exchanged",
    57: "a battery that runs down",
    58: "an inertial sensor at full scale",
    59: "spikes",
    60: "a current, and velocities over ground alone",
    61: "a sensor away from the origin",
    62: "stretches at the surface, in the air, on the bottom, held",
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
    73: "a full or read-only disk",
    74: "two runs into one folder",
    75: "Ctrl-C, SIGTERM, SIGKILL",
    76: "a missing optional package",
    77: "odd names, no terminal",
    78: "one failing job of many",
    79: "an inertia that is not symmetric or not positive definite",
    80: "added mass of the wrong sign",
    81: "damping that adds energy",
    82: "a centre of buoyancy below the centre of gravity",
    83: "no volume, or an inertia of zero",
    84: "very stiff parameters",
    85: "an integration that diverges",
    86: "a solver that does not come to an end",
    87: "a run that leaves what was trained",
    88: "parameters that cannot be told apart",
    89: "a parameter that ends at its bound",
    90: "a fit that explodes or stands still",
    91: "nothing missing",
    92: "two effects that look the same",
    93: "an effect that helps in the fit and not on what was held out",
    94: "another precision, another number of threads",
    95: "a batch of one, no time at all, different lengths",
    96: "a model that goes to another format and back",
    97: "a checkpoint or model that is cut or changed",
    98: "foreign pickles and archives",
    99: "a checkpoint or model of another version, or with other tensors",
    100: "weights that are no numbers",
    101: "a kill while saving",
    102: "a training resumed with other data or options",
    103: "reports of hostile names, very many points, or missing parts",
    104: "a format that cannot hold a part of the model",
    105: "an export that differs from the model",
    106: "messages that are late, repeated, out of order or not numbers, while it adapts",
    107: "no excitation while it adapts",
    108: "a sensor fault that looks like a missing effect",
    109: "parameters that jump or diverge",
    110: "an update that makes the prediction worse",
    111: "an update that takes too long",
    112: "power lost while the state is written",
}

# Tests that stand elsewhere, by row.
ELSEWHERE = {
    1: [
        "tests/logs/readers/test_csv.py::test_paths_that_are_no_file",
        "tests/cli/test_bad_input.py::test_a_missing_file_is_named_with_its_neighbour",
    ],
    3: [
        "tests/logs/readers/test_csv.py::test_parquet_under_a_csv_name_is_detected",
    ],
    4: [
        "tests/logs/readers/test_csv.py::test_what_is_no_table_is_refused",
        "tests/logs/readers/test_parquet.py::test_truncated_and_garbled_files",
    ],
    5: [
        "tests/logs/readers/test_csv.py::test_a_cut_last_row_is_dropped_and_counted",
        "tests/logs/readers/test_parquet.py::test_truncated_and_garbled_files",
    ],
    7: [
        "tests/logs/readers/test_parquet.py::test_a_flipped_bit_in_our_own_file_is_seen",
        "tests/logs/readers/test_parquet_pages.py::test_every_single_byte_of_the_footer_may_be_damaged",
        "tests/logs/test_seal.py::test_a_flipped_bit_is_seen_when_an_own_parquet_log_is_read_in_parts",
        "tests/logs/test_seal.py::test_a_sealed_log_that_changed_is_refused_by_every_way_of_reading",
    ],
    8: [
        "tests/logs/readers/test_recordings.py::test_zeros_within_dataflash_are_skipped_and_counted",
    ],
    11: [
        "tests/logs/readers/test_recordings.py::test_a_reboot_within_dataflash_begins_another_run",
    ],
    12: [
        "tests/logs/readers/test_recordings.py::test_mcap_without_its_end_is_read",
    ],
    13: [
        "tests/logs/readers/test_recordings.py::test_a_ros2_bag_is_a_folder_and_names_what_is_missing",
    ],
    15: [
        "tests/logs/readers/test_recordings.py::test_a_length_of_gigabytes_is_not_believed",
    ],
    18: [
        "tests/logs/readers/test_recordings.py::test_what_a_timetable_becomes",
    ],
    19: [
        "tests/logs/readers/test_csv.py::test_dialects",
        "tests/logs/readers/test_csv.py::test_utf_16_and_latin_1",
    ],
    20: [
        "tests/logs/readers/test_csv.py::test_missing_cells",
        "tests/logs/readers/test_csv.py::test_overflow_is_refused_with_its_line",
    ],
    21: [
        "tests/logs/reading/mapping_file/test_mapping.py::test_missing_columns_come_with_a_mapping_to_copy",
    ],
    22: [
        "tests/logs/readers/test_parquet.py::test_a_footer_that_promises_too_much_memory_is_refused",
    ],
    23: [
        "tests/logs/test_seal.py::test_a_file_that_is_cut_short_while_it_is_read_is_one_line",
    ],
    24: [
        "tests/cli/runs/test_runs.py::test_any_file_name_works",
    ],
    25: [
        "tests/logs/readers/test_recordings.py::test_an_index_beside_an_imc_log_is_never_opened",
    ],
    27: [
        "tests/logs/reading/test_odd_files.py::test_a_block_of_rows_written_twice_is_left_out_once",
    ],
    28: [
        "tests/logs/reading/repairs/test_clock.py::test_any_stamps_give_order_or_a_reason",
        "tests/logs/reading/test_odd_files.py::test_shuffled_rows_are_told_as_such",
    ],
    29: [
        "tests/logs/reading/repairs/test_clock.py::test_a_clock_set_back_is_no_disorder",
    ],
    30: [
        "tests/logs/reading/repairs/test_clock.py::test_leading_zeros_before_a_clock_that_counts_from_1970",
    ],
    33: [
        "tests/logs/quality/test_kinematics.py::test_delay_is_measured",
    ],
    36: [
        "tests/logs/quality/test_quality.py::test_gaps_and_jitter",
    ],
    38: [
        "tests/logs/reading/repairs/test_clock.py::test_times_that_no_log_has",
    ],
    42: [
        "tests/improvement/test_add.py::test_thrusters_at_neutral_say_nothing_about_thrusters",
        "tests/diagnosis/test_diagnose.py::test_thrusters_at_neutral_say_nothing_about_thrusters_and_no_number_pretends_they_do",
        "tests/logs/reading/test_odd_files.py::test_verbs_refuse_what_check_calls_an_error",
    ],
    46: [
        "tests/logs/quality/test_kinematics.py::test_each_reversed_sign_is_found_alone",
    ],
    47: [
        "tests/logs/quality/test_kinematics.py::test_quaternion_order",
    ],
    59: [
        "tests/logs/quality/test_quality.py::test_real_motion_is_no_spike",
    ],
    64: [
        "tests/logs/test_leakage.py::test_overlapping_windows_are_refused",
    ],
    65: [
        "tests/cli/test_bad_input.py::test_a_misspelt_word_gets_the_nearest_names",
    ],
    66: [
        "tests/vehicle/test_refusals.py::test_refusal_names_file_field_value_and_cure",
    ],
    69: [
        "tests/cli/test_bad_input.py::test_a_config_that_would_exhaust_the_machine_is_refused",
        "tests/security/test_foreign_configs.py::test_an_alias_bomb_ends_at_once",
    ],
    70: [
        "tests/cli/test_bad_input.py::test_code_in_a_folder_of_configs_is_refused",
        "tests/security/test_foreign_configs.py::test_what_is_not_a_plain_option_is_refused",
    ],
    71: [
        "tests/storage/test_manifest.py::test_names_that_lead_elsewhere",
    ],
    72: [
        "tests/cli/runs/test_folder.py::test_a_run_that_fails_leaves_the_folder_as_it_was",
        "tests/cli/runs/test_working.py::test_a_working_folder_that_is_a_link_is_refused_and_its_target_untouched",
    ],
    73: [
        "tests/cli/runs/test_runs.py::test_what_the_disk_does_is_not_our_fault",
        "tests/logs/reading/test_odd_files.py::test_a_full_disk_while_a_log_is_written_is_one_line_and_leaves_nothing",
    ],
    74: [
        "tests/cli/runs/test_folder.py::test_two_runs_cannot_have_one_folder",
    ],
    75: [
        "tests/cli/test_ends.py::test_an_interrupted_run_says_so_in_one_line_and_leaves_nothing",
        "tests/cli/test_ends.py::test_a_killed_run_leaves_what_was_there_and_does_not_block_the_next",
    ],
    76: [
        "tests/exports/test_casadi.py::test_a_missing_package_is_said_in_one_line",
    ],
    77: [
        "tests/cli/runs/test_runs.py::test_any_file_name_works",
        "tests/cli/runs/test_runs.py::test_colour_is_for_a_person_at_a_terminal",
    ],
    78: [
        "tests/cli/runs/test_runs.py::test_of_many_jobs_one_may_fail",
    ],
    79: [
        "tests/vehicle/test_refusals.py::test_refusal_names_file_field_value_and_cure",
    ],
    80: [
        "tests/vehicle/test_refusals.py::test_refusal_names_file_field_value_and_cure",
    ],
    81: [
        "tests/training/test_levenberg_marquardt.py::test_damping_that_adds_energy_is_said_with_its_place",
        "tests/training/test_levenberg_marquardt.py::test_dissipative_learns_a_dissipative_law_and_nothing_warns",
    ],
    82: [
        "tests/vehicle/test_reading.py::test_what_is_unlikely_is_warned_about",
    ],
    83: [
        "tests/vehicle/test_refusals.py::test_refusal_names_file_field_value_and_cure",
    ],
    85: [
        "tests/models/free_running/test_rollout.py::test_a_run_with_damping_that_feeds_energy_says_when_and_which_term",
    ],
    88: [
        "tests/improvement/test_add.py::test_parameters_that_cannot_be_told_apart_are_named",
        "tests/training/test_levenberg_marquardt.py::test_what_the_data_cannot_tell_apart_is_said",
        "tests/diagnosis/score_tests/test_score.py::test_what_the_log_says_nothing_about_has_no_p_value_below_one_and_no_standard_error",
    ],
    89: [
        "tests/improvement/test_add.py::test_a_parameter_that_ends_at_its_bound_is_reported",
    ],
    90: [
        "tests/training/test_gradient_schemes.py::test_an_exploding_fit_retreats_stops_with_a_reason_and_keeps_finite_weights",
        "tests/training/test_gradient_schemes.py::test_one_loss_that_is_not_finite_costs_one_epoch",
        "tests/training/test_gradient_schemes.py::test_a_plateau_ends_the_fit",
    ],
    91: [
        "tests/diagnosis/test_diagnose.py::test_nothing_hidden_is_adequate",
    ],
    92: [
        "tests/diagnosis/test_groups.py::test_two_names_for_the_same_thing_are_given_as_a_group",
    ],
    93: [
        "tests/improvement/test_add.py::test_a_model_on_which_nothing_is_missing_gains_nothing_by_an_effect",
    ],
    96: [
        "tests/exports/test_sdf.py::test_a_vehicle_comes_back",
    ],
    97: [
        "tests/training/test_resume.py::test_a_damaged_checkpoint_gives_way_to_the_one_before",
        "tests/training/test_resume.py::test_no_intact_checkpoint_is_an_error_that_names_each",
    ],
    98: [
        "tests/security/test_fuzz.py::test_a_few_damaged_files",
        "tests/storage/test_folders.py::test_a_foreign_file_in_place_of_a_folder",
    ],
    99: [
        "tests/training/test_resume.py::test_missing_tensors_are_listed",
        "tests/training/test_resume.py::test_a_checkpoint_of_a_newer_auvnn_is_refused",
    ],
    100: [
        "tests/models/test_saving.py::test_weights_that_are_not_finite_are_not_saved",
    ],
    101: [
        "tests/storage/test_folders.py::test_interrupted_anywhere_the_old_folder_is_intact",
        "tests/training/test_resume.py::test_a_process_that_is_really_killed_resumes_to_the_same_bits",
        "tests/storage/test_read_back.py::test_what_cannot_be_read_again_does_not_replace_what_can",
    ],
    102: [
        "tests/training/test_resume.py::test_resuming_with_something_changed_is_refused_with_the_difference",
        "tests/training/test_resume.py::test_a_change_can_be_forced_where_the_shapes_allow_it",
    ],
    103: [
        "tests/report/test_pages.py::test_names_from_a_log_stay_text",
        "tests/report/test_pages.py::test_a_million_samples_are_drawn_within_ten_seconds",
        "tests/report/test_pages.py::test_whatever_is_missing_costs_only_its_own_place",
        "tests/report/test_pages.py::test_a_figure_that_cannot_be_rendered_leaves_a_note",
    ],
    104: [
        "tests/exports/test_sdf.py::test_what_is_lost_is_said_and_strict_refuses",
    ],
    105: [
        "tests/exports/test_c.py::test_its_own_test_program_passes_and_notices",
    ],
    106: [
        "tests/online/test_sensors_agree.py::test_attitudes_that_are_no_rotation_are_refused",
        "tests/online/test_faults.py::test_row_106_bad_messages_hold_the_model_and_are_counted",
        "tests/online/test_faults.py::test_row_106_a_gap_is_not_bridged_by_an_increment",
    ],
    107: [
        "tests/online/test_faults.py::test_row_107_an_hour_at_rest_moves_nothing",
        "tests/online/test_faults.py::test_row_107_forgetting_does_not_wind_up",
    ],
    108: [
        "tests/online/test_sensors_agree.py::test_velocity_three_times_too_large_is_refused_and_the_reason_told",
        "tests/online/test_faults.py::test_row_108_a_spike_is_not_learned_and_a_lasting_change_is",
        "tests/online/test_faults.py::test_row_108_a_gyro_that_contradicts_the_attitude_is_not_learned",
        "tests/online/test_faults.py::test_row_108_a_flagged_fault_switches_adaptation_off_for_a_while",
    ],
    109: [
        "tests/online/test_passive.py::test_reversed_thrusters_teach_no_drag_that_gives_energy",
        "tests/online/test_faults.py::test_row_109_wild_proposals_never_leave_the_set",
        "tests/online/test_faults.py::test_row_109_drag_never_begins_to_add_energy",
    ],
    110: [
        "tests/online/test_faults.py::test_row_110_an_update_that_makes_the_prediction_worse_is_taken_back",
        "tests/online/test_faults.py::test_row_110_a_good_update_is_validated",
    ],
    111: [
        "tests/online/test_faults.py::test_row_111_overruns_are_paid_back_by_skipping",
        "tests/online/test_faults.py::test_row_111_memory_does_not_grow",
    ],
    112: [
        "tests/online/test_faults.py::test_row_112_power_loss_leaves_the_old_state",
        "tests/online/test_faults.py::test_row_112_a_damaged_state_is_refused",
        "tests/online/test_faults.py::test_row_112_a_restart_may_begin_from_the_validated_weights",
    ],
}


def table() -> str:
    """Return a table of all rows with their tests: `python -m tests.faults.rows` prints it."""
    own: dict[int, list[str]] = {}
    for file in sorted(Path(__file__).parent.glob("test_*.py")):
        for match in re.finditer(
            r"^def (test_row_(\d+)_\w+)", file.read_text(encoding="utf-8"), re.MULTILINE
        ):
            own.setdefault(int(match[2]), []).append(f"tests/faults/{file.name}::{match[1]}")
    lines = []
    for row, what in ROWS.items():
        tests = [*own.get(row, []), *ELSEWHERE.get(row, [])]
        lines += [f"{row:>3}  {what}", *(f"       {test}" for test in tests)]
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
