// Graphs that repeat themselves, as a chain's bodies do, written as loops.
#pragma once

#include <optional>

#include "code_writer.hpp"

namespace bellcrank {

// The code with a loop for each repetition; nothing where that would save little, or take too much of the stack.
std::optional<Code> write_rolled(const Graph& graph, const Uses& uses, const std::vector<Stage>& stages,
                                 const CodeStyle& style, const Limits& limits);

}  // namespace bellcrank
