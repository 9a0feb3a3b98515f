"""Mask R-CNN: which objects are in an RGB-D picture, and which pixels are theirs."""
