// How a graph that repeats itself is divided into loops and straight code, and where values are kept in memory.
#pragma once

#include <array>
#include <vector>

#include "schedule.hpp"

namespace bellcrank {

// A number for each instance of a loop: base + step k in instance k, or a table's where there is no such rule.
struct Index {
  long base = 0, step = 0;
  int table = -1;
};

// A value that the instances of a loop read: nodes[k] in instance k.
struct Column {
  enum class Kind {
    constant,   // the same in all
    constants,  // in a table
    input,      // entries of an input
    memory,     // slots of %passed
    carried     // computed by the instance before; nodes[0] in the first one
  };
  Kind kind = Kind::constant;
  std::vector<int> nodes;
  Index at;          // which entry, or slot, or column of the table of constants
  int input = 0;     // which input
  int computed = 0;  // carried: which operation of an instance
};

// What an operation of a loop's body, or a column, is written to: an output, or slots of %passed.
struct Target {
  int from;  // the operation, or −1 − column
  int output = -1;
  Index at;
};

// Instances of a body of operations: `nodes` has those of one instance after the other. If `of_sines`, these are angles
// whose sines and cosines are written to slots sines[0] + …, sines[1] + … (−1 for none).
struct Loop {
  int period, count;
  std::vector<int> nodes;
  bool of_sines = false;
  std::array<int, 2> sines{-1, -1};
  std::vector<std::array<int, 3>> operands;  // by operation: those of the same instance, or −1 − column
  std::vector<int> order;                    // of the operations
  std::vector<Column> columns;
  std::vector<Target> targets;
  std::vector<std::vector<int>> tables;        // of Index
  std::vector<std::vector<double>> constants;  // of Column
  bool reads_itself = false;                   // reads slots that it writes

  int node(int instance, int place) const { return nodes[instance * period + place]; }
};

// An output's entry and its node, −1 for zero.
struct OutputEntry {
  int output, entry, node;
};

// One function: straight code (steps as in Schedule), or a loop if its count is not 0.
struct Segment {
  std::vector<int> steps;
  std::vector<OutputEntry> outputs;  // written after the steps
  std::vector<int> leaves;           // constants and inputs that are copied to slots
  Loop loop{0, 0, {}};
};

struct RolledPlan {
  std::vector<Segment> segments;
  std::vector<std::vector<int>> waves;
  std::vector<int> slots;  // by node; −1 for none
  int memory = 0;
  int length = 0;  // operations of the code
};

// `packed` angles share a vector.
RolledPlan rolled_plan(const Graph& graph, const Uses& uses, const std::vector<Stage>& stages, const Limits& limits,
                       int packed);

}  // namespace bellcrank
