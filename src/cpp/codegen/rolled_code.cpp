#include "rolled_code.hpp"

#include "loop_writer.hpp"
#include "part_writer.hpp"
#include "rolled_plan.hpp"

namespace bellcrank {
namespace {

constexpr double WORTH = 0.6;            // the largest share of the operations that the code may have
constexpr long STACK = 4 * 1024 * 1024;  // bytes: half of what a thread usually has

void write_straight(PartWriter& part, const Segment& segment, const RolledPlan& plan) {
  for (const int leaf : segment.leaves) part.write_copy(leaf);
  for (const int step : segment.steps) {
    if (step < 0) {
      part.write_wave(plan.waves[-1 - step]);
    } else {
      part.write_step(step);
    }
  }
  for (const OutputEntry& output : segment.outputs) part.write_output(output.output, output.entry, output.node);
}

}  // namespace

std::optional<Code> write_rolled(const Graph& graph, const Uses& uses, const std::vector<Stage>& stages,
                                 const CodeStyle& style, const Limits& limits) {
  const int operations = graph.operations();
  if (operations < limits.rolled) return {};
  const RolledPlan plan = rolled_plan(graph, uses, stages, limits, style.lanes.width > 1 ? 1 : style.packed);
  if (plan.length > WORTH * operations) return {};
  if (plan.memory * static_cast<long>(sizeof(double)) * style.lanes.width > STACK) return {};
  Code code;
  FunctionWriter functions(style, code);
  for (std::size_t s = 0; s < plan.segments.size(); ++s) {
    const Segment& segment = plan.segments[s];
    if (segment.loop.count) {
      LoopWriter loop(graph, plan, segment.loop, style, static_cast<int>(s), code.library);
      loop.write();
      code.before += loop.globals.text;
      functions.write(loop.allocas, loop.text.text, false);
    } else if (!segment.steps.empty() || !segment.outputs.empty() || !segment.leaves.empty()) {
      PartWriter part(graph, uses, plan.slots, style, code.library);
      write_straight(part, segment, plan);
      functions.write(part.allocas, part.text.text, false);
    }
  }
  functions.finish(plan.memory);
  return code;
}

}  // namespace bellcrank
