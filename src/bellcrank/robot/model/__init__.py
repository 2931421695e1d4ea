"""The robot as data: its tree, joints, friction and payloads, and Pinocchio's model of it."""
