"""Hypotheses about what is missing, and the fit of one of them.

`candidates` says which effects a log can judge and cuts its windows, `stated_priors` lays out nuisance parameters and
effects in one model, `learned_drag` keeps of subnetworks what drag can be. `fit` fits one hypothesis,
`outlier_restart` brings back windows that diverged, `measured_start` begins again from measured states,
`refine_step` shortens the integrator's step where it matters, and `put_into_model` puts the result into a model.
"""
