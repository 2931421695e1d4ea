// Straight-line code of one function, between given loads and stores.
#pragma once

#include <string>
#include <unordered_map>
#include <vector>

#include "ir_text.hpp"
#include "schedule.hpp"

namespace bellcrank {

class PartWriter {
 public:
  Text text;
  std::vector<std::string> allocas;
  std::string label = "body";  // the basic block being written

  // `slots` are the places in the memory %passed of values that go from function to function, by node.
  PartWriter(const Graph& graph, const Uses& uses, const std::vector<int>& slots, const CodeStyle& style,
             std::set<std::string>& library)
      : graph_(graph), uses_(uses), slots_(slots), style_(style), library_(library) {}

  void write_step(int node);
  // Sines and cosines of several angles; those of angles that are too large are the C library's. The result of a lane
  // depends on the angle in that lane alone.
  void write_wave(const std::vector<int>& angles);
  void write_output(int output, int entry, int node);  // −1 for zero
  void write_copy(int node);                           // of a value into its slot
  void write_leaf_outputs();  // outputs that are zeros, constants or inputs

 private:
  struct Pack {
    int at;
    Lanes lanes;
    std::string angles;
    std::vector<int> members;
    std::string results[2], beyond;
  };
  const Graph& graph_;
  const Uses& uses_;
  const std::vector<int>& slots_;
  const CodeStyle& style_;
  std::set<std::string>& library_;
  std::unordered_map<int, std::string> names_;

  const std::string& value(int node);
  std::string slot(int node);
  void hand_on(int node);
  std::string packed(const Lanes& lanes, const std::string& tag, const std::vector<int>& angles);
  std::vector<std::pair<Lanes, std::vector<int>>> groups(std::vector<int> angles) const;
  std::string buffer(const std::string& tag, int at);
  void write_exact(const std::string& tag, const std::vector<Pack>& packs, int count, int region);
  void name_results(const std::string& tag, const std::vector<Pack>& packs, int region);
};

}  // namespace bellcrank
