#include "code_writer.hpp"

#include <optional>

#include "part_writer.hpp"
#include "rolled_code.hpp"

namespace bellcrank {

std::string FunctionWriter::pointers(const char* attribute) const {
  std::string listed;
  for (const std::string& pointer : style_.pointers) listed += std::string("ptr ") + attribute + "%" + pointer + ", ";
  return listed + "ptr " + attribute + "%passed";
}

void FunctionWriter::write(const std::vector<std::string>& allocas, const std::string& text, bool joined) {
  Text function, call;
  function.add("define internal void @part", count_, "(", pointers("noalias "), ") ",
               joined ? "alwaysinline" : "noinline", " alignstack(64) {");
  function.add("body:");
  for (const std::string& line : allocas) function.add(line);
  function.text += text;
  function.line("ret void");
  function.add("}");
  code_.before += function.text;
  call.line("call void @part", count_, "(", pointers(""), ")");
  code_.lines += call.text;
  ++count_;
}

void FunctionWriter::finish(int memory) {
  code_.allocas.push_back("  %passed = alloca [" + std::to_string(memory) + " x " + style_.lanes.number_type +
                          "], align 64");
}

Code write_code(const Graph& traced, const CodeStyle& style, const Limits& limits) {
  const Graph graph = style.fused ? contracted(traced) : traced;
  const Uses uses(graph);
  const std::vector<Stage> found = stages(graph, uses);
  if (const std::optional<Code> rolled = write_rolled(graph, uses, found, style, limits)) return *rolled;
  const Schedule plan(graph, uses, found, limits);
  Code code;
  FunctionWriter functions(style, code);
  for (std::size_t k = 0; k < plan.parts.size(); ++k) {
    PartWriter part(graph, uses, plan.slots, style, code.library);
    for (const int step : plan.parts[k]) {
      if (step < 0) {
        part.write_wave(plan.waves[-1 - step]);
      } else {
        part.write_step(step);
      }
    }
    if (k == 0) part.write_leaf_outputs();
    if (plan.parts.size() == 1) {
      code.lines = part.text.text;
      code.allocas = part.allocas;
      code.label = part.label;
      return code;
    }
    functions.write(part.allocas, part.text.text, plan.joined);
  }
  functions.finish(plan.memory);
  return code;
}

}  // namespace bellcrank
