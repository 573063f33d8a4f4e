"""Operation of the antenna: a console, single commands, the page, and servers for other programs.

These programs use the topics of the graph only. They subscribe to its state (`remote_node`), and publish commands on
acu/command and NODE/inject.
"""
