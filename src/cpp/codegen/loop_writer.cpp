#include "loop_writer.hpp"

namespace bellcrank {

LoopWriter::LoopWriter(const Graph& graph, const RolledPlan& plan, const Loop& loop, const CodeStyle& style, int number,
                       std::set<std::string>& library)
    : graph_(graph),
      plan_(plan),
      loop_(loop),
      style_(style),
      library_(library),
      number_(std::to_string(number)),
      read_(loop.columns.size()) {}

void LoopWriter::write() {
  write_globals();
  write_head();
  for (const Target& target : loop_.targets)
    if (target.from < 0) write_target(target);
  for (const int place : loop_.order) write_operation_of(place);
  if (loop_.of_sines) write_sines();
  write_end();
}

// Rows of the tables: those of one instance after the other.
void LoopWriter::write_globals() {
  const auto write = [&](const std::string& name, const char* type, const auto& columns, const auto& literal) {
    if (columns.empty()) return;
    std::string rows;
    for (int k = 0; k < loop_.count; ++k)
      for (const auto& column : columns) rows += std::string(rows.empty() ? "" : ", ") + type + " " + literal(column[k]);
    globals.add("@", name, number_, " = internal constant [", columns.size() * loop_.count, " x ", type, "] [", rows,
                "]");
  };
  write("places", "i32", loop_.tables, [](int place) { return std::to_string(place); });
  write("numbers", "double", loop_.constants, [](double value) { return Lanes::literal(value); });
}

void LoopWriter::write_head() {
  std::vector<std::pair<std::string, const Column*>> carried;
  for (std::size_t c = 0; c < loop_.columns.size(); ++c) {
    if (loop_.columns[c].kind != Column::Kind::carried) continue;
    read_[c] = "%c" + std::to_string(c);
    carried.push_back({first_value(loop_.columns[c], read_[c] + ".first"), &loop_.columns[c]});
  }
  text.line("br label %loop");
  text.add("loop:");
  text.line("%i = phi i64 [ 0, %body ], [ %next, %", loop_.of_sines ? "done" : "loop", " ]");
  std::size_t at = 0;
  for (std::size_t c = 0; c < loop_.columns.size(); ++c) {
    if (loop_.columns[c].kind != Column::Kind::carried) continue;
    const auto& [first, column] = carried[at++];
    text.line(read_[c], " = phi ", style_.lanes.number_type, " [ ", first, ", %body ], [ %b", column->computed,
              ", %loop ]");
  }
}

void LoopWriter::write_end() {
  text.line("%next = add i64 %i, 1");
  text.line("%more = icmp ult i64 %next, ", loop_.count);
  text.line("br i1 %more, label %loop, label %end");
  text.add("end:");
}

// The value that the first instance reads, before the loop.
std::string LoopWriter::first_value(const Column& column, const std::string& name) {
  const Node& node = graph_.nodes[column.nodes[0]];
  if (node.op == Op::constant) return style_.lanes.number(node.value);
  if (node.op == Op::input) {
    text.add("  ", style_.load_of(node.operand[0], std::to_string(node.operand[1]), name));
  } else {
    text.line(name, ".at = getelementptr ", style_.lanes.number_type, ", ptr %passed, i64 ",
              plan_.slots[column.nodes[0]]);
    text.line(name, " = load ", style_.lanes.number_type, ", ptr ", name, ".at");
  }
  return name;
}

void LoopWriter::write_operation_of(int place) {
  const Node& node = graph_.nodes[loop_.node(0, place)];
  std::string args[3];
  for (int k = 0; k < node.operands(); ++k) {
    const int operand = loop_.operands[place][k];
    args[k] = operand < 0 ? value(-1 - operand) : "%b" + std::to_string(operand);
  }
  write_operation(text, style_.lanes, node.op, "%b" + std::to_string(place), args, library_);
  for (const Target& target : loop_.targets)
    if (target.from == place) write_target(target);
}

void LoopWriter::write_target(const Target& target) {
  const std::string from = target.from < 0 ? value(-1 - target.from) : "%b" + std::to_string(target.from);
  const std::string name = "%to" + std::to_string(targets_++);
  if (target.output >= 0) {
    const std::string entry = index(target.at, name);
    text.add("  ", style_.store_of(target.output, entry, from, name + ".p"));
    return;
  }
  const std::string at = index(target.at, name);
  text.line(name, ".p = getelementptr ", style_.lanes.number_type, ", ptr %passed, i64 ", at);
  text.line("store ", style_.lanes.number_type, " ", from, ", ptr ", name, ".p",
            loop_.reads_itself ? "" : ", !alias.scope !1");
}

// The value of a column in the present instance. `alone`: not to be loaded together with others.
const std::string& LoopWriter::value(int column, bool alone) {
  std::string& name = read_[column];
  if (!name.empty()) return name;
  const Column& read = loop_.columns[column];
  if (read.kind == Column::Kind::constant) return name = style_.lanes.number(graph_.nodes[read.nodes[0]].value);
  name = "%c" + std::to_string(column);
  load(read, name, alone);
  return name;
}

void LoopWriter::load(const Column& column, const std::string& name, bool alone) {
  const std::string& d = style_.lanes.number_type;
  if (column.kind == Column::Kind::constants) {
    const std::string single = style_.lanes.width > 1 ? name + ".one" : name;
    text.line(name, ".row = mul i64 %i, ", loop_.constants.size());
    text.line(name, ".at = add i64 ", name, ".row, ", column.at.base);
    text.line(name, ".p = getelementptr double, ptr @numbers", number_, ", i64 ", name, ".at");
    text.line(single, " = load double, ptr ", name, ".p");
    if (style_.lanes.width == 1) return;
    text.line(name, ".head = insertelement ", d, " poison, double ", single, ", i64 0");
    text.line(name, " = shufflevector ", d, " ", name, ".head, ", d, " poison, <", style_.lanes.width,
              " x i32> zeroinitializer");
  } else if (column.kind == Column::Kind::input) {
    std::string code = style_.load_of(column.input, index(column.at, name), name);
    if (alone) code.replace(code.find(" load "), 6, " load volatile ");
    text.add("  ", code);
  } else {
    const std::string at = index(column.at, name);
    text.line(name, ".p = getelementptr ", d, ", ptr %passed, i64 ", at);
    text.line(name, " = load ", alone ? "volatile " : "", d, ", ptr ", name, ".p",
              loop_.reads_itself ? "" : ", !noalias !1");
  }
}

std::string LoopWriter::index(const Index& at, const std::string& name) {
  if (at.table >= 0) {
    text.line(name, ".row = mul i64 %i, ", loop_.tables.size());
    text.line(name, ".column = add i64 ", name, ".row, ", at.table);
    text.line(name, ".place.p = getelementptr i32, ptr @places", number_, ", i64 ", name, ".column");
    text.line(name, ".place = load i32, ptr ", name, ".place.p");
    text.line(name, ".at = zext i32 ", name, ".place to i64");
  } else if (at.step == 0) {
    return std::to_string(at.base);
  } else {
    text.line(name, ".turn = mul i64 %i, ", at.step);
    text.line(name, ".at = add i64 ", name, ".turn, ", at.base);
  }
  return name + ".at";
}

// Sines and cosines of the angles of an instance, as PartWriter::write_wave has them.
void LoopWriter::write_sines() {
  const Lanes lanes = style_.lanes.width > 1 ? style_.lanes : Lanes(loop_.period);
  const SineCode& code = style_.sine_codes.at(lanes.width);
  const std::string angles = packed_angles(lanes);
  const auto named = [&](const std::string& format) { return filled(format, {{"tag", "t"}, {"x", angles}}); };
  text.add(named(code.lines));
  const std::string fast[2] = {named(code.sine), named(code.cosine)}, beyond = named(code.beyond);
  const std::string width = std::to_string(lanes.width);
  text.line("%mask = bitcast ", lanes.bit_type, " ", beyond, " to i", width);
  text.line("%slow = icmp ne i", width, " %mask, 0");
  text.line("br i1 %slow, label %exact, label %done, !prof !2");
  write_exact(lanes, angles, fast, beyond);
  text.add("done:");
  const std::string names[2] = {"%sine", "%cosine"};
  for (int kind = 0; kind < 2; ++kind)
    text.line(names[kind], " = phi ", lanes.number_type, " [ ", fast[kind], ", %loop ], [ %exact", kind, ", %exact ]");
  for (int kind = 0; kind < 2; ++kind) {
    if (loop_.sines[kind] < 0) continue;
    const std::string& name = names[kind];
    const std::string at = index({loop_.sines[kind], loop_.period, -1}, name);
    text.line(name, ".p = getelementptr ", style_.lanes.number_type, ", ptr %passed, i64 ", at);
    text.line("store ", lanes.number_type, " ", name, ", ptr ", name, ".p", loop_.period > 1 ? ", align 8" : "");
  }
}

std::string LoopWriter::packed_angles(const Lanes& lanes) {
  if (loop_.period == 1) return value(-1 - loop_.operands[0][0]);
  std::string whole = "poison";
  for (int j = 0; j < loop_.period; ++j) {
    const std::string angle = value(-1 - loop_.operands[j][0], true), next = "%x" + std::to_string(j);
    text.line(next, " = insertelement ", lanes.number_type, " ", whole, ", double ", angle, ", i64 ", j);
    whole = next;
  }
  return whole;
}

void LoopWriter::write_exact(const Lanes& lanes, const std::string& angles, const std::string (&fast)[2],
                             const std::string& beyond) {
  library_.insert({"sin", "cos"});
  constexpr int REGION = 8;
  const std::string& d = lanes.number_type;
  allocas.push_back("  %angles = alloca [" + std::to_string(3 * REGION) + " x double], align 64");
  text.add("exact:");
  text.line("store ", d, " ", angles, ", ptr %angles");
  text.line("call void @exact_sincos(ptr %angles, i64 ", lanes.width, ", i64 ", REGION, ")");
  for (int kind = 0; kind < 2; ++kind) {
    text.line("%p", kind, " = getelementptr double, ptr %angles, i64 ", (kind + 1) * REGION);
    text.line("%library", kind, " = load ", d, ", ptr %p", kind);
    text.line("%exact", kind, " = select ", lanes.bit_type, " ", beyond, ", ", d, " %library", kind, ", ", d, " ",
              fast[kind]);
  }
  text.line("br label %done");
}

}  // namespace bellcrank
