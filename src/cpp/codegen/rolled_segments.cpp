#include "rolled_segments.hpp"

#include "repetitions.hpp"

namespace bellcrank {
namespace {

constexpr int FEWEST_ANGLES = 16;  // whose sines are computed in a loop
constexpr int FEWEST_COPIES = 8;   // outputs that are copied in a loop
constexpr int LONG = 2'000;         // operations of straight code

// Divides a graph's operations into loops and straight code.
class Divider {
 public:
  Divider(const Graph& graph, const Uses& uses, const Limits& limits) : graph_(graph), uses_(uses), limits_(limits) {}

  RolledPlan divide(const std::vector<Stage>& stages, int packed) {
    plan_.segments.emplace_back();  // copies of leaves
    for (const Stage& stage : stages) {
      add_operations(stage.operations);
      add_angles(stage.angles, packed);
    }
    add_pending();
    add_leaf_outputs();
    return std::move(plan_);
  }

 private:
  const Graph& graph_;
  const Uses& uses_;
  const Limits& limits_;
  RolledPlan plan_;
  std::vector<int> pending_;  // straight steps that are not in a segment yet

  // In the graph's order; depth first, which takes more memory, where long code becomes a good deal shorter.
  void add_operations(const std::vector<int>& operations) {
    std::vector<int> deep;
    for (const int place : depth_first(reads_among(graph_, operations), places_of(operations)))
      deep.push_back(operations[place]);
    const std::vector<Run> runs = repetitions(graph_, operations), deep_runs = repetitions(graph_, deep);
    const int count = static_cast<int>(operations.size());
    const int left = count - saved(runs), deep_left = count - saved(deep_runs);
    if (left > LONG && deep_left < 0.9 * left) {
      add_runs(deep, deep_runs);
    } else {
      add_runs(operations, runs);
    }
  }

  static int saved(const std::vector<Run>& runs) {
    int count = 0;
    for (const Run& run : runs) count += (run.count - 1) * run.period;
    return count;
  }

  // Where the operations that no other of these reads are among them.
  std::vector<int> places_of(const std::vector<int>& operations) const {
    std::vector<int> place(graph_.nodes.size()), found;
    for (std::size_t i = 0; i < operations.size(); ++i) place[operations[i]] = static_cast<int>(i);
    for (const int end : ends_of(graph_, operations)) found.push_back(place[end]);
    return found;
  }

  void add_runs(const std::vector<int>& operations, const std::vector<Run>& runs) {
    int done = 0;
    const auto add_straight = [&](int end) {
      const std::vector<int> part(operations.begin() + done, operations.begin() + end);
      const std::vector<int> order = locally_ordered(graph_, part, ends_of(graph_, part), limits_.quick(graph_));
      pending_.insert(pending_.end(), order.begin(), order.end());
    };
    for (const Run& run : runs) {
      add_straight(run.start);
      done = run.start + run.period * run.count;
      add_loop({run.period, run.count, {operations.begin() + run.start, operations.begin() + done}});
    }
    add_straight(static_cast<int>(operations.size()));
  }

  void add_angles(const std::vector<int>& angles, int packed) {
    const int count = static_cast<int>(angles.size()) / packed, whole = packed * count;
    if (whole < FEWEST_ANGLES) {
      add_wave(angles);
      return;
    }
    add_wave({angles.begin() + whole, angles.end()});
    Loop loop{packed, count, {angles.begin(), angles.begin() + whole}};
    loop.of_sines = true;
    add_loop(std::move(loop));
  }

  void add_wave(std::vector<int> angles) {
    if (angles.empty()) return;
    pending_.push_back(-1 - static_cast<int>(plan_.waves.size()));
    plan_.waves.push_back(std::move(angles));
  }

  void add_pending() {
    plan_.length += static_cast<int>(pending_.size());
    for (std::vector<int>& steps : cut(pending_, limits_.part)) {
      plan_.segments.emplace_back();
      plan_.segments.back().steps = std::move(steps);
    }
    pending_.clear();
  }

  void add_loop(Loop loop) {
    add_pending();
    plan_.length += loop.period;
    std::vector<OutputEntry> late;
    if (loop.of_sines) {
      for (const int angle : loop.nodes)
        for (const int sine : uses_.sines[angle]) add_outputs(sine, late);
    } else {
      for (int j = 0; j < loop.period; ++j) add_targets(loop, j, late);
    }
    plan_.segments.emplace_back();
    plan_.segments.back().loop = std::move(loop);
    if (late.empty()) return;
    plan_.segments.emplace_back();
    plan_.segments.back().outputs = std::move(late);
  }

  void add_outputs(int node, std::vector<OutputEntry>& found) const {
    if (node < 0) return;
    for (const auto& [output, entry] : uses_.places[node]) found.push_back({output, entry, node});
  }

  // The outputs that an operation of a loop writes; those that differ between instances are written after the loop.
  void add_targets(Loop& loop, int place, std::vector<OutputEntry>& late) const {
    const auto& first = uses_.places[loop.node(0, place)];
    std::vector<std::vector<int>> entries(first.size());
    for (int k = 0; k < loop.count; ++k) {
      const auto& places = uses_.places[loop.node(k, place)];
      bool alike = places.size() == first.size();
      for (std::size_t r = 0; alike && r < first.size(); ++r) {
        alike = places[r].first == first[r].first;
        entries[r].push_back(places[r].second);
      }
      if (alike) continue;
      for (int other = 0; other < loop.count; ++other) add_outputs(loop.node(other, place), late);
      return;
    }
    for (std::size_t r = 0; r < first.size(); ++r)
      loop.targets.push_back({place, first[r].first, index_of(loop, entries[r])});
  }

  // Outputs that are zeros, constants or inputs: runs of entries of an input, or of one constant, in loops.
  void add_leaf_outputs() {
    std::vector<OutputEntry> single;
    for (std::size_t output = 0; output < graph_.outputs.size(); ++output) {
      const Output& of = graph_.outputs[output];
      std::vector<int> node(of.size, -1);
      for (std::size_t i = 0; i < of.nodes.size(); ++i) node[of.entries[i]] = of.nodes[i];
      const auto is_leaf = [&](int i) { return node[i] < 0 || graph_.nodes[node[i]].is_leaf(); };
      const auto follows = [&](int i) {
        if (node[i] < 0 || node[i - 1] < 0) return false;
        const Node &a = graph_.nodes[node[i - 1]], &b = graph_.nodes[node[i]];
        return is_leaf(i) && a.op == Op::input && b.op == Op::input && a.operand[0] == b.operand[0] &&
               b.operand[1] == a.operand[1] + 1;
      };
      for (int i = 0, end; i < of.size; i = end) {
        end = i + 1;
        if (!is_leaf(i)) continue;
        while (end < of.size && follows(end)) ++end;
        if (end - i >= FEWEST_COPIES) {
          add_copies(static_cast<int>(output), i, {node.begin() + i, node.begin() + end});
        } else {
          for (int entry = i; entry < end; ++entry) single.push_back({static_cast<int>(output), entry, node[entry]});
        }
      }
    }
    plan_.segments[0].outputs = std::move(single);
  }

  void add_copies(int output, int entry, std::vector<int> nodes) {
    const int count = static_cast<int>(nodes.size());
    Loop loop{0, count, {}};
    Column column;
    column.nodes = std::move(nodes);
    loop.columns.push_back(std::move(column));
    loop.targets.push_back({-1, output, {entry, 1, -1}});
    plan_.segments.emplace_back();
    plan_.segments.back().loop = std::move(loop);
  }
};

}  // namespace

std::vector<int> ends_of(const Graph& graph, const std::vector<int>& operations) {
  const Reads reads = reads_among(graph, operations);
  std::vector<char> is_read(operations.size());
  for (const std::vector<int>& of_one : reads)
    for (const int a : of_one) is_read[a] = true;
  std::vector<int> ends;
  for (std::size_t i = 0; i < operations.size(); ++i)
    if (!is_read[i]) ends.push_back(operations[i]);
  return ends;
}

Index index_of(Loop& loop, const std::vector<int>& numbers) {
  Index index;
  index.base = numbers[0];
  index.step = numbers.size() > 1 ? numbers[1] - numbers[0] : 0;
  for (std::size_t k = 0; k < numbers.size(); ++k)
    if (numbers[k] != index.base + index.step * static_cast<long>(k)) {
      index.table = static_cast<int>(loop.tables.size());
      loop.tables.push_back(numbers);
      break;
    }
  return index;
}

RolledPlan divided(const Graph& graph, const Uses& uses, const std::vector<Stage>& stages, const Limits& limits,
                   int packed) {
  return Divider(graph, uses, limits).divide(stages, packed);
}

}  // namespace bellcrank
