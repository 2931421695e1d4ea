#include "schedule.hpp"

#include <algorithm>
#include <functional>
#include <queue>

namespace bellcrank {
namespace {

// The angles whose sine or cosine is taken, by how many sines deep they lie.
std::vector<std::vector<int>> waves(const Graph& graph) {
  std::vector<int> depth(graph.nodes.size());
  std::vector<char> seen(graph.nodes.size());
  std::vector<std::vector<int>> found;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    const Node& node = graph.nodes[i];
    for (int k = 0; k < node.operands(); ++k) depth[i] = std::max(depth[i], depth[node.operand[k]]);
    if (!node.is_sine()) continue;
    const std::size_t below = depth[i];
    if (found.size() <= below) found.resize(below + 1);
    if (!seen[node.operand[0]]) found[below].push_back(node.operand[0]);
    seen[node.operand[0]] = true;
    ++depth[i];
  }
  return found;
}

// The operations that the roots need and that are not done yet, in the graph's order; marks them as done.
std::vector<int> ancestors(const Graph& graph, std::vector<int> roots, std::vector<char>& done) {
  std::vector<int> found;
  while (!roots.empty()) {
    const int i = roots.back();
    roots.pop_back();
    if (done[i]) continue;
    done[i] = true;
    const Node& node = graph.nodes[i];
    if (node.is_leaf()) continue;
    found.push_back(i);
    roots.insert(roots.end(), node.operand, node.operand + node.operands());
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

Uses::Uses(const Graph& graph) : sines(graph.nodes.size(), {-1, -1}), places(graph.nodes.size()) {
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    const Node& node = graph.nodes[i];
    if (node.is_sine()) sines[node.operand[0]][node.op == Op::cos] = static_cast<int>(i);
  }
  for (std::size_t k = 0; k < graph.outputs.size(); ++k) {
    const Output& output = graph.outputs[k];
    for (std::size_t i = 0; i < output.nodes.size(); ++i)
      places[output.nodes[i]].push_back({static_cast<int>(k), output.entries[i]});
  }
}

std::vector<Stage> stages(const Graph& graph, const Uses& uses) {
  std::vector<char> done(graph.nodes.size());
  std::vector<Stage> found;
  for (const std::vector<int>& angles : waves(graph)) {
    found.push_back({ancestors(graph, angles, done), angles});
    for (const int angle : angles)
      for (const int sine : uses.sines[angle])
        if (sine >= 0) done[sine] = true;
  }
  found.push_back({ancestors(graph, graph.roots(), done), {}});
  return found;
}

Reads reads_among(const Graph& graph, const std::vector<int>& operations) {
  std::vector<int> place(graph.nodes.size(), -1);
  for (std::size_t i = 0; i < operations.size(); ++i) place[operations[i]] = static_cast<int>(i);
  Reads reads(operations.size());
  for (std::size_t i = 0; i < operations.size(); ++i) {
    const Node& node = graph.nodes[operations[i]];
    for (int k = 0; k < node.operands(); ++k) {
      const int a = place[node.operand[k]];
      if (a >= 0 && std::find(reads[i].begin(), reads[i].end(), a) == reads[i].end()) reads[i].push_back(a);
    }
  }
  return reads;
}

std::vector<int> locally_ordered(const Graph& graph, const std::vector<int>& operations, const std::vector<int>& roots,
                                 bool quick) {
  std::vector<int> place(graph.nodes.size(), -1), outputs, order;
  for (std::size_t i = 0; i < operations.size(); ++i) place[operations[i]] = static_cast<int>(i);
  for (const int root : roots)
    if (place[root] >= 0) outputs.push_back(place[root]);
  for (const int i : local_order(reads_among(graph, operations), outputs, quick)) order.push_back(operations[i]);
  return order;
}

std::vector<std::vector<int>> cut(const std::vector<int>& steps, int length) {
  const std::size_t size = steps.size(), count = (size + length - 1) / length;
  std::vector<std::vector<int>> parts;
  for (std::size_t k = 0; k < count; ++k)
    parts.emplace_back(steps.begin() + size * k / count, steps.begin() + size * (k + 1) / count);
  return parts;
}

Schedule::Schedule(const Graph& graph, const Uses& uses, const std::vector<Stage>& stages, const Limits& limits) {
  std::vector<int> steps;
  for (const Stage& stage : stages) {
    if (stage.angles.empty()) {
      const std::vector<int> order = locally_ordered(graph, stage.operations, graph.roots(), limits.quick(graph));
      steps.insert(steps.end(), order.begin(), order.end());
    } else {
      steps.insert(steps.end(), stage.operations.begin(), stage.operations.end());
      steps.push_back(-1 - static_cast<int>(waves.size()));
      waves.push_back(stage.angles);
    }
  }
  const int count = static_cast<int>(steps.size());
  parts = graph.operations() > limits.lengthy || count > limits.whole ? cut(steps, limits.part)
                                                                       : std::vector<std::vector<int>>{steps};
  find_slots(graph, uses);
  joined = !limits.quick(graph) && count <= limits.whole && memory <= limits.waiting;
}

std::vector<int> Schedule::reads(const Graph& graph, int step) const {
  if (step < 0) return waves[-1 - step];
  const Node& node = graph.nodes[step];
  return {node.operand, node.operand + node.operands()};
}

std::vector<int> Schedule::makes(const Uses& uses, int step) const {
  if (step >= 0) return {step};
  std::vector<int> made;
  for (const int angle : waves[-1 - step])
    for (const int sine : uses.sines[angle])
      if (sine >= 0) made.push_back(sine);
  return made;
}

void Schedule::find_slots(const Graph& graph, const Uses& uses) {
  const std::size_t count = graph.nodes.size();
  std::vector<int> made(count, -1), last(count, -1);  // by node: the part that computes it; the last that reads it
  for (int k = 0; k < static_cast<int>(parts.size()); ++k)
    for (const int step : parts[k]) {
      for (const int a : reads(graph, step))
        if (made[a] >= 0 && made[a] < k) last[a] = k;
      for (const int i : makes(uses, step)) made[i] = k;
    }
  std::vector<std::vector<int>> begins(parts.size()), ends(parts.size());
  for (int i = 0; i < static_cast<int>(count); ++i)
    if (last[i] >= 0) {
      begins[made[i]].push_back(i);
      ends[last[i]].push_back(i);
    }
  slots.assign(count, -1);
  memory = 0;
  std::priority_queue<int, std::vector<int>, std::greater<>> free;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    for (const int i : begins[k]) {
      if (free.empty()) free.push(memory++);
      slots[i] = free.top();
      free.pop();
    }
    for (const int i : ends[k]) free.push(slots[i]);  // free from the next part on
  }
}

}  // namespace bellcrank
