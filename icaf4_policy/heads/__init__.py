"""The prediction heads: each reads the features of a point and ends in a three-layer MLP."""
