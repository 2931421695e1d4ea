// The ensemble engine for machines with AVX2 and FMA, four lanes.
#define BELLCRANK_ISA avx2
#include "lane_engine.hpp"
