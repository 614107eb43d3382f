"""Parameters of effects and coefficients estimated from a log, by prediction errors or by equation errors.

`window_simulation` runs windows free, `sensitivity` differentiates them, `window_normal_equations` and
`sufficient_statistics` turn that into small sums, and `prediction_error` fits by them (multiple shooting with
estimated initial states), where `initial_steps` takes a share of the step of single windows; `initial_states`
estimates these alone, `nuisance_elimination` eliminates parameters that are not asked for. `one_step_error` fits by
accelerations one step ahead, with `point_slopes`, `linear_effects` and `few_inputs` for the derivatives; `priors`
holds what is assumed of free parameters in both.
"""
