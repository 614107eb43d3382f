"""From commands to thrust.

`actuators` holds static curves and the allocation, and lets the actuator effects act over time. `thrust_signal` is
what comes of it: the thrust as a function of time. `actuator_states` states what the actuators remember as a state,
for estimators and controllers. `acting` says what comes beside the thrust, `command_path` how a model states that
commands go between a log's samples.
"""
