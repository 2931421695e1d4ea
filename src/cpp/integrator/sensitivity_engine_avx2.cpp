// Sensitivities along a run, for machines with AVX2 and FMA.
#define BELLCRANK_ISA avx2
#include "sensitivity_pass.hpp"
