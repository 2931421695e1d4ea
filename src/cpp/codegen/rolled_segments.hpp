// The segments of a rolled plan: loops where operations repeat themselves, straight code elsewhere.
#pragma once

#include "rolled_plan.hpp"

namespace bellcrank {

// The plan without columns, slots and orders; `packed` angles share a vector.
RolledPlan divided(const Graph& graph, const Uses& uses, const std::vector<Stage>& stages, const Limits& limits,
                   int packed);

// The rule of these numbers, by instance; if they have none they become a table of the loop.
Index index_of(Loop& loop, const std::vector<int>& numbers);

// The operations that no other of these reads.
std::vector<int> ends_of(const Graph& graph, const std::vector<int>& operations);

}  // namespace bellcrank
