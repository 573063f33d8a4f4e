"""Operation of the antenna: the commands, the control over them, and the reports of the control unit."""
