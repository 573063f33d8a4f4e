"""The position loop of an axis and the laws it is made of."""
