"""Scenario: its file, its parameters, and the program track that follows from it.

    header      the section `scenario`
    sections    sections of the nodes, and their checked parameters
    files       texts and files, and changes 'node.key=value'
    rules       parameters that follow from others
    scenario    draft and checked scenario
    program     program track of the operator
"""
