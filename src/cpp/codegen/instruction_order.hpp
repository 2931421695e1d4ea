// Orders of operations in which few values are live, so that fewer are spilled to memory.
#pragma once

#include <vector>

namespace bellcrank {

// What each operation reads of the others, each once and in the order of its operands; operations go by their place.
using Reads = std::vector<std::vector<int>>;

// An order, operands first, in which values are used soon. `outputs` are the operations whose values are wanted.
// Finding the best order is hard (register allocation with free order). Therefore some cheap orders are compared by how
// many operands were last used long ago; fewer of them if it has to be `quick`.
std::vector<int> local_order(const Reads& reads, const std::vector<int>& outputs, bool quick);

// Each output's operations in turn, the last output's first; of an operation's operands the deepest first. The last
// outputs are a tree's leaves, which a recursion towards the root meets first.
std::vector<int> depth_first(const Reads& reads, const std::vector<int>& outputs);

}  // namespace bellcrank
