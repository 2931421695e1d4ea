// bellcrank._codegen: expression graphs from casadi's instructions, and their code in LLVM IR.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/set.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "code_writer.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace bellcrank {
namespace {

template <typename T>
using Vector = nb::ndarray<const T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

template <typename T>
nb::object array_of(std::vector<T> values, std::size_t columns = 0) {
  auto* held = new std::vector<T>(std::move(values));
  nb::capsule owner(held, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  if (!columns) return nb::cast(nb::ndarray<nb::numpy, T, nb::ndim<1>>(held->data(), {held->size()}, owner));
  return nb::cast(nb::ndarray<nb::numpy, T, nb::ndim<2>>(held->data(), {held->size() / columns, columns}, owner));
}

nb::tuple arrays_of(const Graph& graph) {
  std::vector<std::uint8_t> op;
  std::vector<std::int32_t> operands;
  std::vector<double> value;
  for (const Node& node : graph.nodes) {
    op.push_back(static_cast<std::uint8_t>(node.op));
    operands.insert(operands.end(), node.operand, node.operand + 3);
    value.push_back(node.value);
  }
  nb::list outputs;
  for (const Output& output : graph.outputs)
    outputs.append(nb::make_tuple(output.size, array_of(std::vector<std::int32_t>(output.entries)),
                                  array_of(std::vector<std::int32_t>(output.nodes))));
  return nb::make_tuple(array_of(std::move(op)), array_of(std::move(operands), 3), array_of(std::move(value)),
                        nb::tuple(outputs));
}

nb::tuple build(Vector<std::int32_t> op, Vector<std::int32_t> result, Vector<std::int32_t> first,
                Vector<std::int32_t> second, Vector<double> constant,
                const std::vector<std::pair<int, Vector<std::int64_t>>>& outs) {
  std::vector<Output> outputs;
  for (const auto& [size, places] : outs)
    outputs.push_back({size, {places.data(), places.data() + places.size()}, {}});
  const Instructions columns{op.data(), result.data(), first.data(), second.data(), constant.data(), op.size()};
  Graph graph;
  {
    nb::gil_scoped_release released;
    graph = graph_of(columns, outputs);
  }
  return arrays_of(graph);
}

Graph read_graph(nb::handle object) {
  const auto op = nb::cast<Vector<std::uint8_t>>(object.attr("op"));
  const auto operands = nb::cast<nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig>>(object.attr("operands"));
  const auto value = nb::cast<Vector<double>>(object.attr("value"));
  Graph graph;
  for (std::size_t i = 0; i < op.size(); ++i)
    graph.nodes.push_back({static_cast<Op>(op.data()[i]), {operands(i, 0), operands(i, 1), operands(i, 2)}, value.data()[i]});
  for (nb::handle output : nb::tuple(object.attr("outputs"))) {
    const auto entries = nb::cast<Vector<std::int32_t>>(output[1]), nodes = nb::cast<Vector<std::int32_t>>(output[2]);
    graph.outputs.push_back({nb::cast<int>(output[0]),
                             {entries.data(), entries.data() + entries.size()},
                             {nodes.data(), nodes.data() + nodes.size()}});
  }
  return graph;
}

Limits read_limits(nb::handle limits) {
  const auto number = [&](const char* name) { return nb::cast<int>(limits.attr(name)); };
  return {number("whole"), number("part"), number("waiting"), number("rolled"), number("lengthy"),
          nb::cast<bool>(limits.attr("seldom"))};
}

// sine_codes: by width (lines, sine, cosine, "beyond the limit" bit).
using SineTexts = std::map<int, std::tuple<std::string, std::string, std::string, std::string>>;

nb::tuple write_text(nb::object graph, nb::object limits, int width, bool fused, int packed, std::string load, std::string store,
                std::vector<std::string> pointers, const SineTexts& sine_codes) {
  CodeStyle style{Lanes(width), fused, packed, std::move(load), std::move(store), std::move(pointers), {}};
  for (const auto& [lanes, texts] : sine_codes) {
    const auto& [lines, sine, cosine, beyond] = texts;
    style.sine_codes[lanes] = {lines, sine, cosine, beyond};
  }
  const Graph nodes = read_graph(graph);
  const Limits numbers = read_limits(limits);
  Code made;
  {
    nb::gil_scoped_release released;
    made = write_code(nodes, style, numbers);
  }
  return nb::make_tuple(made.lines, made.allocas, made.label, made.before, made.library);
}

nb::tuple contract(nb::object graph) { return arrays_of(contracted(read_graph(graph))); }

nb::tuple schedule(nb::object graph, nb::object limits) {
  const Graph nodes = read_graph(graph);
  const Uses uses(nodes);
  const Schedule plan(nodes, uses, stages(nodes, uses), read_limits(limits));
  return nb::make_tuple(plan.parts, plan.waves, plan.slots, plan.memory, plan.joined);
}

std::vector<std::string> operation_names() { return {std::begin(OPERATION_NAMES), std::end(OPERATION_NAMES)}; }

}  // namespace
}  // namespace bellcrank

NB_MODULE(_codegen, m) {
  using namespace bellcrank;
  m.def("operation_names", &operation_names);
  m.def("build", &build, "op"_a, "result"_a, "first"_a, "second"_a, "constant"_a, "outputs"_a);
  m.def("write", &write_text, "graph"_a, "limits"_a, "width"_a, "fused"_a, "packed"_a, "load"_a, "store"_a, "pointers"_a,
        "sine_codes"_a);
  m.def("contract", &contract, "graph"_a);
  m.def("schedule", &schedule, "graph"_a, "limits"_a);
  m.attr("CASADI_VERSION") = BELLCRANK_CASADI_VERSION;
  m.attr("ASSIGN") = Instructions::ASSIGN;
  m.attr("STORE") = Instructions::STORE;
}
