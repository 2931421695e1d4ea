#include "rolled_plan.hpp"

#include <algorithm>
#include <map>
#include <numeric>

#include "rolled_segments.hpp"
#include "slots.hpp"

namespace bellcrank {
namespace {

// Where a node is computed: which segment, which instance of its loop, which operation of it.
struct Home {
  int segment = -1, instance = 0, place = 0;
};

// Finds what each segment reads from others, and places it in memory.
class Placer {
 public:
  Placer(const Graph& graph, const Uses& uses, const Limits& limits, RolledPlan& plan)
      : graph_(graph), uses_(uses), limits_(limits), plan_(plan), home_(graph.nodes.size()),
        last_(graph.nodes.size(), -1) {}

  void place() {
    find_homes();
    for (std::size_t s = 0; s < plan_.segments.size(); ++s) read(static_cast<int>(s));
    place_values();
    for (Segment& segment : plan_.segments) resolve(segment.loop);
  }

 private:
  const Graph& graph_;
  const Uses& uses_;
  const Limits& limits_;
  RolledPlan& plan_;
  std::vector<Home> home_;
  std::vector<int> last_;  // by node: the last segment that reads it from memory, −1 for none

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
    std::vector<int> wanted = ends_of(graph_, body);
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
  RolledPlan plan = divided(graph, uses, stages, limits, packed);
  Placer(graph, uses, limits, plan).place();
  return plan;
}

}  // namespace bellcrank
