"""One file per plot: arrays in, a matplotlib Figure out; nothing here shows, saves or knows an answer."""
