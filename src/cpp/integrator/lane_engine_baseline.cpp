// The ensemble engine for any x86-64, two lanes.
#define BELLCRANK_ISA baseline
#include "lane_engine.hpp"
