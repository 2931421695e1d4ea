"""Compiles casadi expression graphs to machine code with LLVM, for one sample or a batch, and caches it on disk."""
