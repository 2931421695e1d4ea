// Expression graphs in single-assignment form: the input of the compiler.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace bellcrank {

// clang-format off
enum class Op : std::uint8_t {
  constant, input,  // leaves
  neg, exp, log, sqrt, sq, twice, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, log1p, expm1, logical_not, floor,
  ceil, fabs, sign, inv,  // of one operand
  add, sub, mul, div, pow, constpow, lt, le, eq, ne, logical_and, logical_or, fmod, copysign, if_else_zero, fmin, fmax,
  atan2, hypot,  // of two
  fma, fms, fnma  // a b + c, a b - c, c - a b, rounded once: made by contracted()
};

// The names by which casadi's operations are known, in the order of Op.
inline constexpr std::string_view OPERATION_NAMES[] = {
  "const", "input",
  "neg", "exp", "log", "sqrt", "sq", "twice", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh",
  "log1p", "expm1", "not", "floor", "ceil", "fabs", "sign", "inv",
  "add", "sub", "mul", "div", "pow", "constpow", "lt", "le", "eq", "ne", "and", "or", "fmod", "copysign",
  "if_else_zero", "fmin", "fmax", "atan2", "hypot", "fma", "fms", "fnma"};
// clang-format on

inline std::string_view name_of(Op op) { return OPERATION_NAMES[static_cast<std::size_t>(op)]; }

inline int operand_count(Op op) { return op <= Op::input ? 0 : op < Op::add ? 1 : op < Op::fma ? 2 : 3; }

// One operation. Operands are earlier nodes; for an input they are (which input, which entry).
struct Node {
  Op op;
  int operand[3];
  double value;  // of a constant

  int operands() const { return operand_count(op); }
  bool is_leaf() const { return op <= Op::input; }
  bool is_sine() const { return op == Op::sin || op == Op::cos; }
};

// A dense vector of `size` entries: entries[i] is the value of nodes[i], the others are zero.
struct Output {
  int size;
  std::vector<int> entries, nodes;
};

struct Graph {
  std::vector<Node> nodes;
  std::vector<Output> outputs;

  int operations() const {
    return static_cast<int>(
        std::count_if(nodes.begin(), nodes.end(), [](const Node& node) { return !node.is_leaf(); }));
  }

  // The nodes that are outputs, in the outputs' order.
  std::vector<int> roots() const {
    std::vector<int> found;
    for (const Output& output : outputs) found.insert(found.end(), output.nodes.begin(), output.nodes.end());
    return found;
  }
};

// The instructions of a casadi function, one column each; `op` is an Op, or one of the two that make no value.
struct Instructions {
  static constexpr int ASSIGN = -1, STORE = -2;
  const std::int32_t *op, *result, *first, *second;
  const double* constant;
  std::size_t count;
};

// The graph of these instructions; repeated constants, inputs and operations become one node, and several divisions by
// the same number one reciprocal and products. `outputs` has the sizes and, by stored entry, the places in the vector.
Graph graph_of(const Instructions& instructions, const std::vector<Output>& outputs);

// The graph with each product that only one sum or difference reads contracted into it. Of two such products the later
// one is contracted, because the sum waits for it. The optimiser could contract them as well, but does so differently at
// each of its levels and wherever code is divided into functions. Decided here, the code of a graph gives the same
// results to the last bit at every level, however it is divided, for one sample and for many.
Graph contracted(const Graph& graph);

}  // namespace bellcrank
