"""Look-ahead: it predicts keyholes and hidden sectors on the path of the target, and plans slews through keyholes."""
