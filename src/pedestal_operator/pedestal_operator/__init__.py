"""Operation of the antenna by persons and by other programs: a console, single commands, the page in a browser, and
servers for other programs.

All of these use the topics of the graph only. They subscribe to its state (`remote_node`), and publish commands on
acu/command and NODE/inject.
"""
