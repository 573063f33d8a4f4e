"""Command line, graph, recorder, bags, studies and report of the tracking-antenna pedestal."""
