"""The point-cloud backbone and the compiled neighbourhood searches below it."""
