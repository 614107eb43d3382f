"""The whole catalogue ranked one step ahead.

`slopes` differentiates accelerations by parameters, `refit` fits one effect beside everything that is uncertain
(`weighted_fit`), `rank` orders the catalogue by errors on parts left out; `fit` puts such a fit where a diagnosis
expects one of windows.
"""
