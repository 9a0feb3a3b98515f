"""The point-cloud backbone, its neighbourhood searches, and the classical descriptors."""
