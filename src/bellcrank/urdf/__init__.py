"""Reading URDF files: finding them by name, checked data, and what may be wrong with them."""
