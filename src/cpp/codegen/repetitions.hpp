// Repetitions in a sequence of operations, as the bodies of a chain and the loops of a row of linkages make them.
#pragma once

#include <vector>

#include "graph.hpp"

namespace bellcrank {

// operations[start], … are `count` instances of `period` operations each. They do the same with the values of their own
// instance; what they read from elsewhere may differ.
struct Run {
  int start, period, count;
};

// The repetitions in these operations (nodes, operands first), in their order and without overlap.
std::vector<Run> repetitions(const Graph& graph, const std::vector<int>& operations);

}  // namespace bellcrank
