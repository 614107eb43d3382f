"""Score models against logs: windows, one-step residuals, free-running errors."""
