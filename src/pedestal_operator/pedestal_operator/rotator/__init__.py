"""The protocols of antenna rotators, and the controller behind them."""
