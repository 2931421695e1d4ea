#include "rolled_plan.hpp"

#include <algorithm>
#include <map>
#include <numeric>

#include "repetitions.hpp"
#include "slots.hpp"

namespace bellcrank {
namespace {

constexpr int FEWEST_ANGLES = 16;  // whose sines are computed in a loop
constexpr int FEWEST_COPIES = 8;   // outputs that are copied in a loop

// Where a node is computed: which segment, which instance of its loop, which operation of it.
struct Home {
  int segment = -1, instance = 0, place = 0;
};

// The rule of these numbers, if they have one.
bool is_affine(const std::vector<int>& numbers, Index& index) {
  index.base = numbers[0];
  index.step = numbers.size() > 1 ? numbers[1] - numbers[0] : 0;
  for (std::size_t k = 0; k < numbers.size(); ++k)
    if (numbers[k] != index.base + index.step * static_cast<long>(k)) return false;
  return true;
}

Index index_of(Loop& loop, const std::vector<int>& numbers) {
  Index index;
  if (is_affine(numbers, index)) return index;
  index.table = static_cast<int>(loop.tables.size());
  loop.tables.push_back(numbers);
  return index;
}

class Planner {
 public:
  Planner(const Graph& graph, const Uses& uses, const Limits& limits)
      : graph_(graph), uses_(uses), limits_(limits), home_(graph.nodes.size()), last_(graph.nodes.size(), -1) {}

  RolledPlan plan(const std::vector<Stage>& stages, int packed) {
    plan_.segments.emplace_back();  // copies of leaves
    for (const Stage& stage : stages) {
      add_operations(stage.operations);
      add_angles(stage.angles, packed);
    }
    add_pending();
    add_leaf_outputs();
    find_homes();
    for (std::size_t s = 0; s < plan_.segments.size(); ++s) read(static_cast<int>(s));
    place_values();
    for (Segment& segment : plan_.segments) resolve(segment.loop);
    return std::move(plan_);
  }

 private:
  const Graph& graph_;
  const Uses& uses_;
  const Limits& limits_;
  RolledPlan plan_;
  std::vector<int> pending_;  // straight steps that are not in a segment yet
  std::vector<Home> home_;
  std::vector<int> last_;  // by node: the last segment that reads it from memory, −1 for none

  // ---- segments

  void add_operations(const std::vector<int>& operations) {
    int done = 0;
    const auto add_straight = [&](int end) {
      const std::vector<int> part(operations.begin() + done, operations.begin() + end);
      const std::vector<int> order = locally_ordered(graph_, part, ends_of(part), limits_.quick(graph_));
      pending_.insert(pending_.end(), order.begin(), order.end());
    };
    for (const Run& run : repetitions(graph_, operations)) {
      add_straight(run.start);
      done = run.start + run.period * run.count;
      add_loop({run.period, run.count, {operations.begin() + run.start, operations.begin() + done}});
    }
    add_straight(static_cast<int>(operations.size()));
  }

  // The operations that no other of these reads.
  std::vector<int> ends_of(const std::vector<int>& operations) const {
    const Reads reads = reads_among(graph_, operations);
    std::vector<char> is_read(operations.size());
    for (const std::vector<int>& of_one : reads)
      for (const int a : of_one) is_read[a] = true;
    std::vector<int> ends;
    for (std::size_t i = 0; i < operations.size(); ++i)
      if (!is_read[i]) ends.push_back(operations[i]);
    return ends;
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

  void find_homes() {
    for (int s = 0; s < static_cast<int>(plan_.segments.size()); ++s) {
      const Segment& segment = plan_.segments[s];
      for (const int step : segment.steps) {
        if (step >= 0) {
          home_[step] = {s, 0, 0};
        } else {
          for (const int angle : plan_.waves[-1 - step]) set_home_of_sines(angle, {s, 0, 0});
        }
      }
      const Loop& loop = segment.loop;
      for (int k = 0; k < loop.count; ++k)
        for (int j = 0; j < loop.period; ++j) {
          if (loop.of_sines) {
            set_home_of_sines(loop.node(k, j), {s, k, j});
          } else {
            home_[loop.node(k, j)] = {s, k, j};
          }
        }
    }
  }

  void set_home_of_sines(int angle, const Home& home) {
    for (const int sine : uses_.sines[angle])
      if (sine >= 0) home_[sine] = home;
  }

  // ---- reads

  void read(int s) {
    Segment& segment = plan_.segments[s];
    for (const int step : segment.steps) {
      if (step < 0) {
        for (const int angle : plan_.waves[-1 - step]) read_from_memory(angle, s);
      } else {
        const Node& node = graph_.nodes[step];
        for (int k = 0; k < node.operands(); ++k) read_from_memory(node.operand[k], s);
      }
    }
    for (const OutputEntry& output : segment.outputs)
      if (output.node >= 0) read_from_memory(output.node, s);
    if (!segment.loop.count) return;
    find_columns(segment.loop, s);
    for (Column& column : segment.loop.columns) classify(segment.loop, column, s);
  }

  void read_from_memory(int node, int segment) {
    if (graph_.nodes[node].is_leaf() || home_[node].segment == segment) return;
    last_[node] = segment;
  }

  // What the operations read: others of the same instance, or columns.
  void find_columns(Loop& loop, int s) {
    std::map<std::vector<int>, int> known;
    const auto column_of = [&](std::vector<int> nodes) {
      const auto [place, is_new] = known.try_emplace(nodes, static_cast<int>(loop.columns.size()));
      if (is_new) {
        loop.columns.emplace_back();
        loop.columns.back().nodes = std::move(nodes);
      }
      return -1 - place->second;
    };
    for (int j = 0; j < loop.period; ++j) {
      loop.operands.push_back({0, 0, 0});
      const Node& node = graph_.nodes[loop.node(0, j)];
      for (int which = 0; which < (loop.of_sines ? 1 : node.operands()); ++which) {
        std::vector<int> nodes;
        for (int k = 0; k < loop.count; ++k)
          nodes.push_back(loop.of_sines ? loop.node(k, j) : graph_.nodes[loop.node(k, j)].operand[which]);
        const Home& home = home_[nodes[0]];
        const bool inside = !loop.of_sines && home.segment == s && home.instance == 0;
        loop.operands[j][which] = inside ? home.place : column_of(std::move(nodes));
      }
    }
  }

  void classify(Loop& loop, Column& column, int s) {
    const auto node = [&](int k) -> const Node& { return graph_.nodes[column.nodes[k]]; };
    const auto all = [&](auto&& is_so) {
      for (int k = 0; k < loop.count; ++k)
        if (!is_so(k)) return false;
      return true;
    };
    if (all([&](int k) { return node(k).op == Op::constant; })) {
      classify_constants(loop, column);
    } else if (all([&](int k) { return node(k).op == Op::input && node(k).operand[0] == node(0).operand[0]; })) {
      column.kind = Column::Kind::input;
      column.input = node(0).operand[0];
      std::vector<int> entries;
      for (int k = 0; k < loop.count; ++k) entries.push_back(node(k).operand[1]);
      column.at = index_of(loop, entries);
    } else if (all([&](int k) { return k == 0 || is_carried(column, k, s); })) {
      column.kind = Column::Kind::carried;
      column.computed = home_[column.nodes[1]].place;
      read_from_memory(column.nodes[0], s);
    } else {
      column.kind = Column::Kind::memory;
      for (const int i : column.nodes) {
        last_[i] = s;
        loop.reads_itself = loop.reads_itself || home_[i].segment == s;
        if (graph_.nodes[i].is_leaf()) plan_.segments[0].leaves.push_back(i);
      }
    }
  }

  bool is_carried(const Column& column, int k, int s) const {
    const Home &home = home_[column.nodes[k]], &second = home_[column.nodes[1]];
    return home.segment == s && home.instance == k - 1 && home.place == second.place &&
           !graph_.nodes[column.nodes[k]].is_leaf();
  }

  void classify_constants(Loop& loop, Column& column) const {
    std::vector<double> values;
    for (const int i : column.nodes) values.push_back(graph_.nodes[i].value);
    const auto same = [&](int i) { return i == column.nodes[0]; };
    if (std::all_of(column.nodes.begin(), column.nodes.end(), same)) return;
    column.kind = Column::Kind::constants;
    column.at.base = static_cast<long>(loop.constants.size());
    loop.constants.push_back(std::move(values));
  }

  // ---- memory

  // Each segment takes the slots that later ones read; they are given back after the last of these.
  void place_values() {
    Slots slots;
    plan_.slots.assign(graph_.nodes.size(), -1);
    std::vector<std::vector<std::pair<int, int>>> ending(plan_.segments.size());
    const auto take = [&](const std::vector<int>& nodes, int length, int step) {
      const auto latest = [&](int found, int i) { return std::max(found, last_[i]); };
      const int start = slots.take(length), last = std::accumulate(nodes.begin(), nodes.end(), -1, latest);
      for (std::size_t k = 0; k < nodes.size(); ++k) plan_.slots[nodes[k]] = start + step * static_cast<int>(k);
      ending[last].push_back({start, length});
      return start;
    };
    std::vector<int>& leaves = plan_.segments[0].leaves;
    std::sort(leaves.begin(), leaves.end());
    leaves.erase(std::unique(leaves.begin(), leaves.end()), leaves.end());
    for (const int leaf : leaves) take({leaf}, 1, 0);
    for (std::size_t s = 0; s < plan_.segments.size(); ++s) {
      Segment& segment = plan_.segments[s];
      for (const int step : segment.steps)
        for (const int i : made_by(step))
          if (last_[i] >= 0) take({i}, 1, 0);
      if (segment.loop.of_sines) {
        place_sines(segment.loop, slots, ending);
      } else {
        for (int j = 0; j < segment.loop.period; ++j) place_computed(segment.loop, j, take);
      }
      for (const auto& [start, length] : ending[s]) slots.give_back(start, length);
    }
    plan_.memory = slots.memory;
  }

  std::vector<int> made_by(int step) const {
    if (step >= 0) return {step};
    std::vector<int> made;
    for (const int angle : plan_.waves[-1 - step])
      for (const int sine : uses_.sines[angle])
        if (sine >= 0) made.push_back(sine);
    return made;
  }

  // A slot for each instance; one slot if only the last value is read.
  template <class Take>
  void place_computed(Loop& loop, int place, Take&& take) {
    std::vector<int> nodes;
    int read = 0;
    for (int k = 0; k < loop.count; ++k) {
      nodes.push_back(loop.node(k, place));
      read += last_[nodes.back()] >= 0;
    }
    if (!read) return;
    const bool only_last = read == 1 && last_[nodes.back()] >= 0;
    const int start = only_last ? take({nodes.back()}, 1, 0) : take(nodes, length_of(loop.count), 1);
    loop.targets.push_back({place, -1, {start, only_last ? 0 : 1, -1}});
  }

  // Slots for an array. Arrays of the same length shall not all begin in the same sets of a cache, and so have an odd
  // number of cache lines.
  static int length_of(int count) { return count < 8 ? count : ((count + 7) / 8 | 1) * 8; }

  void place_sines(Loop& loop, Slots& slots, std::vector<std::vector<std::pair<int, int>>>& ending) {
    for (int kind = 0; kind < 2; ++kind) {
      int last = -1;
      for (const int angle : loop.nodes)
        if (uses_.sines[angle][kind] >= 0) last = std::max(last, last_[uses_.sines[angle][kind]]);
      if (last < 0) continue;
      const int length = length_of(static_cast<int>(loop.nodes.size())), start = slots.take(length);
      for (std::size_t k = 0; k < loop.nodes.size(); ++k)
        if (uses_.sines[loop.nodes[k]][kind] >= 0)
          plan_.slots[uses_.sines[loop.nodes[k]][kind]] = start + static_cast<int>(k);
      ending[last].push_back({start, length});
      loop.sines[kind] = start;
    }
  }

  // The slots of columns; the order of the operations.
  void resolve(Loop& loop) {
    for (Column& column : loop.columns) {
      if (column.kind != Column::Kind::memory) continue;
      std::vector<int> places;
      for (const int i : column.nodes) places.push_back(plan_.slots[i]);
      column.at = index_of(loop, places);
    }
    if (loop.of_sines || !loop.period) return;
    const std::vector<int> body(loop.nodes.begin(), loop.nodes.begin() + loop.period);
    std::vector<int> wanted = ends_of(body);
    for (const Target& target : loop.targets) wanted.push_back(body[target.from]);
    for (const Column& column : loop.columns)
      if (column.kind == Column::Kind::carried) wanted.push_back(body[column.computed]);
    for (const int node : locally_ordered(graph_, body, wanted, limits_.quick(graph_)))
      loop.order.push_back(home_[node].place);
  }
};

}  // namespace

RolledPlan rolled_plan(const Graph& graph, const Uses& uses, const std::vector<Stage>& stages, const Limits& limits,
                       int packed) {
  return Planner(graph, uses, limits).plan(stages, packed);
}

}  // namespace bellcrank
