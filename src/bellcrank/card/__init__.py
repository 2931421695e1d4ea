"""Robot cards: one YAML file with a robot's motions, payloads and drives."""
