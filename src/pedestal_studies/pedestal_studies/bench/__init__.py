"""Benchmarks of the graph, the compiled core and bags on this machine: one module each, run() -> its rows."""

BENCH_MODULES = {'graph': 'lockstep', 'core': 'core', 'bag': 'recording'}
"""{name on the command line: module}."""
