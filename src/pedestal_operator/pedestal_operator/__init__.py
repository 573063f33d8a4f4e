"""Operation of the antenna by persons and by other programs: a console, single commands, the page in a browser,
servers.

All of these use the topics of the graph only.
"""
