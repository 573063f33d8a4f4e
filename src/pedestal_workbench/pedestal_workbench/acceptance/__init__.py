"""Acceptance: a specification is measured, requirement by requirement, and becomes a report that is signed.

    specification   what the contract requires: a method with its arguments, a limit, repetitions, a confidence
    methods         the table of the methods: what each excites and measures, its unit and its arguments
    exercise        what a method makes the antenna do, and the recording of it
    servo, margins, tracking, safety    methods by subject: their exercises, and their numbers from recordings
    in_loop         performs an exercise in the closed loop, in memory
    client          commands an exercise on nodes, through acu/command, as an operator does
    own_graph       performs an exercise on a simulated graph that it starts
    running_graph   performs an exercise on the running graph, simulated or real
    sequence        all requirements in order; continues where it stopped
    judgement       value, uncertainty and verdict of a requirement
    document        report: HTML, PDF, JSON, JUnit XML
"""
