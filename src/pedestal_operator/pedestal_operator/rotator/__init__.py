"""Protocols of antenna rotators, and the controller behind them."""
