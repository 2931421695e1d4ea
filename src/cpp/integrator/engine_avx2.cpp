// The engine for machines with AVX2 and FMA (see CMakeLists.txt for the compiler's options).
#define BELLCRANK_ISA avx2
#include "engine.hpp"
