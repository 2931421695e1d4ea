// The order in which a graph's operations are written, and the division of large graphs into functions.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "graph.hpp"
#include "instruction_order.hpp"

namespace bellcrank {

// Sines as early as possible: the operations that angles need, then the angles. The last stage has no angles.
struct Stage {
  std::vector<int> operations;  // nodes, in the graph's order
  std::vector<int> angles;      // whose sines and cosines are computed together: a wave
};

// What the graph's nodes are for.
struct Uses {
  std::vector<std::array<int, 2>> sines;                 // by angle: the nodes of its sine and cosine, -1 for none
  std::vector<std::vector<std::pair<int, int>>> places;  // by node: the outputs (which, entry) that it is

  explicit Uses(const Graph& graph);
};

std::vector<Stage> stages(const Graph& graph, const Uses& uses);

// What each of these operations (nodes, operands first) reads of the others, by place.
Reads reads_among(const Graph& graph, const std::vector<int>& operations);

// These operations in an order in which values are used soon.
std::vector<int> locally_ordered(const Graph& graph, const std::vector<int>& operations, const std::vector<int>& roots,
                                 bool quick);

struct Limits {
  int whole;    // the most operations that are joined
  int part;     // operations per function of a divided graph
  int waiting;  // the most live values in functions that are joined
  int rolled;   // the least operations for which repetitions become loops
  int lengthy;  // the most operations that are optimised in a moment
  bool seldom;  // whether the code is called for some rows only

  // Whether a short compile time matters more than fast code.
  bool quick(const Graph& graph) const { return seldom && graph.operations() > lengthy; }
};

// The steps of each function, and the memory slots in which values are passed to later functions. A step is a node, or
// −1 − w for wave w. Nodes share a slot if the last function that reads one comes before the function that writes the
// next.
struct Schedule {
  std::vector<std::vector<int>> waves, parts;
  std::vector<int> slots;  // by node; −1 for none
  int memory;
  bool joined;  // whether optimised code is one function: its parts are inlined, and what they pass stays in registers

  Schedule(const Graph& graph, const Uses& uses, const std::vector<Stage>& stages, const Limits& limits);

  // The nodes that a step reads, and those that it computes.
  std::vector<int> reads(const Graph& graph, int step) const;
  std::vector<int> makes(const Uses& uses, int step) const;

 private:
  void find_slots(const Graph& graph, const Uses& uses);
};

// Cuts a list into parts of about equal length, of at most `length` members; no part for an empty list.
std::vector<std::vector<int>> cut(const std::vector<int>& steps, int length);

}  // namespace bellcrank
