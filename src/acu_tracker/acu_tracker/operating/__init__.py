"""Operation of the antenna: commands of clients, control by one client, and texts and diagnosis for the operator.

`unit.Acu` uses these modules outside the compiled law.
"""
