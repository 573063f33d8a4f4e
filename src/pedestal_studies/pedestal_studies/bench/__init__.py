"""What this machine makes of the graph, the compiled core and bags: one benchmark a module, run() -> its rows."""

BENCH_MODULES = {'graph': 'lockstep', 'core': 'core', 'bag': 'recording'}
"""{name on the command line: module}."""
