#include "graph.hpp"

#include <cstring>
#include <unordered_map>
#include <utility>

namespace bellcrank {
namespace {

// Collects nodes; equal operations, also with swapped operands of a sum or product, become one node.
class Builder {
 public:
  std::vector<Node> nodes;

  int add(Op op, int a, int b = -1) {
    if ((op == Op::add || op == Op::mul) && a > b) std::swap(a, b);
    return known(operations_, key(op, a, b), Node{op, {a, b, -1}, 0.0});
  }

  int leaf(const Node& node) {
    if (node.op == Op::input) return known(operations_, key(node.op, node.operand[0], node.operand[1]), node);
    std::uint64_t bits;
    std::memcpy(&bits, &node.value, sizeof bits);
    return known(constants_, bits, node);
  }

 private:
  std::unordered_map<std::uint64_t, int> operations_, constants_;

  static std::uint64_t key(Op op, int a, int b) {  // 2^28 nodes would take 6 GB
    return static_cast<std::uint64_t>(op) << 56 | static_cast<std::uint64_t>(a) << 28 |
           (static_cast<std::uint64_t>(b) & 0xFFFFFFF);
  }

  int known(std::unordered_map<std::uint64_t, int>& map, std::uint64_t key, const Node& node) {
    const auto [place, is_new] = map.try_emplace(key, static_cast<int>(nodes.size()));
    if (is_new) nodes.push_back(node);
    return place->second;
  }
};

Graph with_shared_reciprocals(const Graph& graph) {
  std::vector<int> divisions(graph.nodes.size());
  for (const Node& node : graph.nodes) {
    if (node.op == Op::div) ++divisions[node.operand[1]];
    if (node.op == Op::inv) ++divisions[node.operand[0]];
  }
  Builder builder;
  std::vector<int> place(graph.nodes.size());
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    const Node& node = graph.nodes[i];
    const auto operand = [&](int which) { return place[node.operand[which]]; };
    if (node.is_leaf()) {
      place[i] = builder.leaf(node);
    } else if (node.operands() == 1) {
      place[i] = builder.add(node.op, operand(0));
    } else if (node.op == Op::div && divisions[node.operand[1]] > 1) {
      const int inverse = builder.add(Op::inv, operand(1));
      place[i] = builder.add(Op::mul, operand(0), inverse);
    } else {
      place[i] = builder.add(node.op, operand(0), operand(1));
    }
  }
  Graph made{std::move(builder.nodes), graph.outputs};
  for (Output& output : made.outputs)
    for (int& node : output.nodes) node = place[node];
  return made;
}

}  // namespace

Graph graph_of(const Instructions& instructions, const std::vector<Output>& outputs) {
  Builder builder;
  Graph graph;
  for (const Output& output : outputs) graph.outputs.push_back({output.size, {}, {}});
  std::vector<int> value;  // the node in each of the function's registers
  const auto at = [&](int place) -> int& {
    if (place >= static_cast<int>(value.size())) value.resize(place + 1, -1);
    return value[place];
  };
  for (std::size_t k = 0; k < instructions.count; ++k) {
    const int code = instructions.op[k], result = instructions.result[k];
    const int first = instructions.first[k], second = instructions.second[k];
    if (code == Instructions::STORE) {
      Output& output = graph.outputs[result];
      output.entries.push_back(outputs[result].entries[static_cast<int>(instructions.constant[k])]);
      output.nodes.push_back(at(first));
      continue;
    }
    int made;
    const Op op = static_cast<Op>(code);
    if (code == Instructions::ASSIGN) {
      made = at(first);
    } else if (op == Op::constant) {
      made = builder.leaf({op, {0, 0, -1}, instructions.constant[k]});
    } else if (op == Op::input) {
      made = builder.leaf({op, {first, second, -1}, 0.0});
    } else if (operand_count(op) == 1) {
      made = builder.add(op, at(first));
    } else {
      made = builder.add(op, at(first), at(second));
    }
    at(result) = made;
  }
  graph.nodes = std::move(builder.nodes);
  return with_shared_reciprocals(graph);
}

Graph contracted(const Graph& graph) {
  const std::size_t count = graph.nodes.size();
  std::vector<int> uses(count), product(count, -1), place(count);  // product: which operand of a sum is contracted
  std::vector<char> absorbed(count);
  for (const Node& node : graph.nodes)
    for (int k = 0; k < node.operands(); ++k) ++uses[node.operand[k]];
  for (const int root : graph.roots()) ++uses[root];
  const auto is_single_product = [&](int i) {
    return uses[i] == 1 && (graph.nodes[i].op == Op::mul || graph.nodes[i].op == Op::sq);
  };
  for (std::size_t i = 0; i < count; ++i) {
    const Node& node = graph.nodes[i];
    if (node.op != Op::add && node.op != Op::sub) continue;
    for (int k = 0; k < 2; ++k)
      if (is_single_product(node.operand[k]) && (product[i] < 0 || node.operand[1] > node.operand[0])) product[i] = k;
    if (product[i] >= 0) absorbed[node.operand[product[i]]] = true;
  }
  Graph made{{}, graph.outputs};
  for (std::size_t i = 0; i < count; ++i) {
    if (absorbed[i]) continue;
    place[i] = static_cast<int>(made.nodes.size());
    Node node = graph.nodes[i];
    if (product[i] >= 0) {
      const Node& factors = graph.nodes[node.operand[product[i]]];
      const int other = node.operand[1 - product[i]];
      const Op op = node.op == Op::add ? Op::fma : product[i] == 0 ? Op::fms : Op::fnma;
      node = {op, {factors.operand[0], factors.operand[factors.op == Op::mul], other}, 0.0};
    }
    for (int k = 0; k < node.operands(); ++k) node.operand[k] = place[node.operand[k]];
    made.nodes.push_back(node);
  }
  for (Output& output : made.outputs)
    for (int& node : output.nodes) node = place[node];
  return made;
}

}  // namespace bellcrank
