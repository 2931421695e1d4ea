// The engine for any x86-64.
#define BELLCRANK_ISA baseline
#include "engine.hpp"
