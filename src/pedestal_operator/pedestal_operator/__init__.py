"""What operates the antenna: a console, one-shot commands, and the servers that other programs talk to.

They know the graph by its topics only: they hear what it tells (`remote_node`), and ask on acu/command and
NODE/inject.
"""
