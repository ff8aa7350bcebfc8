"""Sweeps: one scenario many times, each time with other parameters; one table, one row a run.

    scenario = "sidereal"        a shipped scenario, or a file beside this one
    method = "grid"              or "latin_hypercube" or "monte_carlo", with runs and seed
    runs, seed
    decimation                   ticks for each row that the statistics see; the scenario's where not given
    timeout                      seconds after which a run is given up
    record = true                keep the recording of each run
    [vary]                       what is varied, see `variation` and `address`
    [statistics]                 what is kept of a run, see `statistics`

A run that fails, gives no finite number, crashes its process or takes too long is a row with its reason.
"""
