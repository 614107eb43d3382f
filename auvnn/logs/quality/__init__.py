"""The quality report of a log.

`quality` assembles it: `channel_quality` and `excitation` by channel, `kinematics`, `vertical`, `lever` and
`situations` by what sensors say about one another; `findings` and `sensor_findings` say it in plain words, each a
`finding`.
"""
