"""From expression graphs to machine code: LLVM IR, one sample or a batch, and the cache on disk."""
