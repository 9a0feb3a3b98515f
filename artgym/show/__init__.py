"""Looking: picture sheets and 3D pages of objects, labels and samples, for people."""
