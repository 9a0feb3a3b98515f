"""ICAF-4: part segmentation, poses, joints, affordance and grasps from one RGB-D view."""
