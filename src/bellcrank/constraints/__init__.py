"""What a URDF tree cannot say: closed loops, couplings, driven joints and rolling contact, as constraints."""
