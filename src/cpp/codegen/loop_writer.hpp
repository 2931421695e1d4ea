// The code of a loop: a function's body.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "ir_text.hpp"
#include "rolled_plan.hpp"

namespace bellcrank {

class LoopWriter {
 public:
  Text text, globals;  // the tables that it reads
  std::vector<std::string> allocas;

  // `number` makes the names of tables unique.
  LoopWriter(const Graph& graph, const RolledPlan& plan, const Loop& loop, const CodeStyle& style, int number,
             std::set<std::string>& library);
  void write();

 private:
  const Graph& graph_;
  const RolledPlan& plan_;
  const Loop& loop_;
  const CodeStyle& style_;
  std::set<std::string>& library_;
  const std::string number_;
  std::string label_ = "loop";     // the basic block that is being written
  int targets_ = 0;                // that have been written
  std::vector<std::string> read_;  // by column: the name of its value in the present instance, "" if not loaded yet

  void write_globals();
  void write_head();
  void write_end();
  void write_operation_of(int place);
  void write_sines();
  std::string packed_angles(const Lanes& lanes);
  void write_exact(const Lanes& lanes, const std::string& angles, const std::string (&fast)[2],
                   const std::string& beyond);
  void write_target(const Target& target);
  const std::string& value(int column, bool alone = false);
  void load(const Column& column, const std::string& name, bool alone);
  std::string first_value(const Column& column, const std::string& name);
  std::string index(const Index& at, const std::string& name);
};

}  // namespace bellcrank
