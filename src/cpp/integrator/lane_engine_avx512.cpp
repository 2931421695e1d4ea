// The ensemble engine for machines with AVX-512 (F, DQ, VL), eight lanes.
#define BELLCRANK_ISA avx512
#include "lane_engine.hpp"
