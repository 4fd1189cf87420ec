"""The command line: a file per command; `info`, `presets` and `operators` share one."""
