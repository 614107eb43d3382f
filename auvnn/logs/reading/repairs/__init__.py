"""What is corrected or masked while a log is read, each step counted as a `repair`.

`delays` and `clock` put time right; `validity`, `masks` and `cores` take out what no sensor measured; `attitude`
makes unit quaternions without sign flips. `resets` then splits where an estimated pose starts again, and `plausible`
doubts what no vehicle does.
"""
