// The code of a whole graph in LLVM IR.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "ir_text.hpp"
#include "schedule.hpp"

namespace bellcrank {

struct Code {
  std::string lines;  // of `evaluate`; they begin in the basic block "body" and end in `label`
  std::vector<std::string> allocas;
  std::string label = "body";
  std::string before;  // functions that they call
  std::set<std::string> library;
};

Code write_code(const Graph& graph, const CodeStyle& style, const Limits& limits);

// Functions @part0, @part1, … of the pointers of a style and of %passed, and their calls.
class FunctionWriter {
 public:
  FunctionWriter(const CodeStyle& style, Code& code) : style_(style), code_(code) {}

  // `joined`: the optimiser shall inline it.
  void write(const std::vector<std::string>& allocas, const std::string& text, bool joined);
  void finish(int memory);  // the memory that they share

 private:
  const CodeStyle& style_;
  Code& code_;
  int count_ = 0;

  std::string pointers(const char* attribute) const;
};

}  // namespace bellcrank
