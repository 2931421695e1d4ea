// Sensitivities along a run, for any x86-64.
#define BELLCRANK_ISA baseline
#include "sensitivity_pass.hpp"
