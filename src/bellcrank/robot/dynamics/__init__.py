"""The robot's dynamics: expressions, their derivatives, and the machine code of both."""
