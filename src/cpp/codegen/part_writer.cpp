#include "part_writer.hpp"

#include <map>

namespace bellcrank {

void PartWriter::write_leaf_outputs() {
  for (std::size_t k = 0; k < graph_.outputs.size(); ++k) {
    const Output& output = graph_.outputs[k];
    std::vector<int> node(output.size, -1);
    for (std::size_t i = 0; i < output.nodes.size(); ++i) node[output.entries[i]] = output.nodes[i];
    for (int i = 0; i < output.size; ++i) {
      if (node[i] >= 0 && !graph_.nodes[node[i]].is_leaf()) continue;
      write_output(static_cast<int>(k), i, node[i]);
    }
  }
}

void PartWriter::write_output(int output, int entry, int node) {
  const std::string name = node < 0 ? style_.lanes.number(0.0) : value(node);
  text.add("  ", style_.store_of(output, entry, name));
}

void PartWriter::write_copy(int node) {
  const std::string name = value(node), at = slot(node);
  text.line("store ", style_.lanes.number_type, " ", name, ", ptr ", at);
}

void PartWriter::write_step(int node) {
  const Node& made = graph_.nodes[node];
  std::string args[3];
  for (int k = 0; k < made.operands(); ++k) args[k] = value(made.operand[k]);
  const std::string name = "%v" + std::to_string(node);
  write_operation(text, style_.lanes, made.op, name, args, library_);
  names_[node] = name;
  hand_on(node);
}

// The name of a node's value in this function; loaded from memory if another function computes it.
const std::string& PartWriter::value(int node) {
  const auto known = names_.find(node);
  if (known != names_.end()) return known->second;
  const Node& made = graph_.nodes[node];
  std::string name = "%v" + std::to_string(node);
  if (made.op == Op::constant) {
    name = style_.lanes.number(made.value);
  } else if (made.op == Op::input) {
    text.add("  ", style_.load_of(made.operand[0], std::to_string(made.operand[1]), name));
  } else {
    const std::string at = slot(node);
    text.line(name, " = load ", style_.lanes.number_type, ", ptr ", at);
  }
  return names_[node] = name;
}

std::string PartWriter::slot(int node) {
  const std::string at = "%v" + std::to_string(node) + ".at";
  text.line(at, " = getelementptr ", style_.lanes.number_type, ", ptr %passed, i64 ", slots_[node]);
  return at;
}

// Stores a value that is an output or that a later function reads.
void PartWriter::hand_on(int node) {
  for (const auto& [k, i] : uses_.places[node]) text.add("  ", style_.store_of(k, i, names_[node]));
  if (slots_[node] < 0) return;
  const std::string at = slot(node);
  text.line("store ", style_.lanes.number_type, " ", names_[node], ", ptr ", at);
}

// The angles of a wave, grouped by vector: one each in a batch, packed for one sample.
std::vector<std::pair<Lanes, std::vector<int>>> PartWriter::groups(std::vector<int> angles) const {
  std::vector<std::pair<Lanes, std::vector<int>>> found;
  if (style_.lanes.width > 1) {
    for (const int angle : angles) found.push_back({style_.lanes, {angle}});
    return found;
  }
  while (!angles.empty()) {
    int width = style_.packed;
    while (width >= 2 * static_cast<int>(angles.size())) width /= 2;
    const auto end = angles.begin() + std::min<std::size_t>(width, angles.size());
    found.push_back({Lanes(width), {angles.begin(), end}});
    angles.erase(angles.begin(), end);
  }
  return found;
}

// The values of angles side by side, zeros after them.
std::string PartWriter::packed(const Lanes& lanes, const std::string& tag, const std::vector<int>& angles) {
  if (lanes.width == style_.lanes.width) return value(angles[0]);
  std::string whole = "zeroinitializer";
  for (std::size_t j = 0; j < angles.size(); ++j) {
    const int angle = angles[j];
    const Node& node = graph_.nodes[angle];
    if (node.op == Op::input && names_.find(angle) == names_.end()) {
      // A vector load of what the caller has just stored in other pieces would wait until the cache has it; "volatile"
      // keeps LLVM from making one.
      const std::string name = names_[angle] = "%v" + std::to_string(angle);
      std::string load = style_.load_of(node.operand[0], std::to_string(node.operand[1]), name);
      load.replace(load.find(" load "), 6, " load volatile ");
      text.add("  ", load);
    }
    const std::string member = value(angle), next = "%" + tag + "." + std::to_string(j);
    text.line(next, " = insertelement ", lanes.number_type, " ", whole, ", double ", member, ", i64 ", j);
    whole = next;
  }
  return whole;
}

void PartWriter::write_wave(const std::vector<int>& angles) {
  const std::string tag = "w" + std::to_string(angles[0]);
  const auto grouped = groups(angles);
  int count = 0;
  for (const auto& group : grouped) count += group.first.width;
  const int region = (count + 7) / 8 * 8;  // the buffer holds angles, sines and cosines, in regions of whole vectors
  allocas.push_back("  %" + tag + " = alloca [" + std::to_string(3 * region) + " x double], align 64");
  std::vector<Pack> packs;
  std::vector<std::pair<int, std::string>> beyond;  // by width, in the order of first use
  int at = 0;
  for (const auto& [lanes, members] : grouped) {
    const std::string place = std::to_string(at), x = packed(lanes, tag + ".x" + place, members);
    const SineCode& code = style_.sine_codes.at(lanes.width);
    const std::string inner = tag + ".t" + place;
    const auto named = [&](const std::string& format) { return filled(format, {{"tag", inner}, {"x", x}}); };
    text.add(named(code.lines));
    packs.push_back({at, lanes, x, members, {named(code.sine), named(code.cosine)}, named(code.beyond)});
    std::string flag = packs.back().beyond;
    auto known = beyond.begin();
    while (known != beyond.end() && known->first != lanes.width) ++known;
    if (known == beyond.end()) {
      beyond.push_back({lanes.width, flag});
    } else {
      text.line("%", tag, ".any", at, " = or ", lanes.bit_type, " ", known->second, ", ", flag);
      known->second = "%" + tag + ".any" + place;
    }
    at += lanes.width;
  }
  std::string slow = "false";
  for (const auto& [width, flag] : beyond) {
    text.line("%", tag, ".mask", width, " = bitcast ", Lanes(width).bit_type, " ", flag, " to i", width);
    text.line("%", tag, ".lane", width, " = icmp ne i", width, " %", tag, ".mask", width, ", 0");
    text.line("%", tag, ".slow", width, " = or i1 %", tag, ".lane", width, ", ", slow);
    slow = "%" + tag + ".slow" + std::to_string(width);
  }
  library_.insert({"sin", "cos"});
  text.line("br i1 ", slow, ", label %", tag, ".exact, label %", tag, ".done, !prof !2");
  write_exact(tag, packs, count, region);
  name_results(tag, packs, region);
}

// The block of the C library's sines and cosines.
void PartWriter::write_exact(const std::string& tag, const std::vector<Pack>& packs, int count, int region) {
  text.add(tag, ".exact:");
  for (const Pack& pack : packs) {
    const std::string place = buffer(tag, pack.at);
    text.line("store ", pack.lanes.number_type, " ", pack.angles, ", ptr ", place);
  }
  text.line("call void @exact_sincos(ptr %", tag, ", i64 ", count, ", i64 ", region, ")");
  for (const Pack& pack : packs)
    for (int kind = 0; kind < 2; ++kind) {
      const int offset = pack.at + (kind + 1) * region;
      const std::string &d = pack.lanes.number_type, place = buffer(tag, offset);
      text.line("%", tag, ".c", offset, " = load ", d, ", ptr ", place);
      text.line("%", tag, ".e", offset, " = select ", pack.lanes.bit_type, " ", pack.beyond, ", ", d, " %", tag, ".c",
                offset, ", ", d, " ", pack.results[kind]);
    }
  text.line("br label %", tag, ".done");
}

// The block after both ways; names the values of sines and cosines: a lane of a vector, or the vector in a batch.
void PartWriter::name_results(const std::string& tag, const std::vector<Pack>& packs, int region) {
  const std::string before = label;
  label = tag + ".done";
  text.add(label, ":");
  for (const Pack& pack : packs)
    for (int kind = 0; kind < 2; ++kind) {
      const int offset = pack.at + (kind + 1) * region;
      text.line("%", tag, ".r", offset, " = phi ", pack.lanes.number_type, " [ ", pack.results[kind], ", %", before,
                " ], [ %", tag, ".e", offset, ", %", tag, ".exact ]");
    }
  for (const Pack& pack : packs)
    for (std::size_t j = 0; j < pack.members.size(); ++j)
      for (int kind = 0; kind < 2; ++kind) {
        const int node = uses_.sines[pack.members[j]][kind];
        if (node < 0) continue;
        std::string vector = "%" + tag + ".r" + std::to_string(pack.at + (kind + 1) * region);
        if (pack.lanes.width > style_.lanes.width) {
          const std::string name = "%v" + std::to_string(node);
          text.line(name, " = extractelement ", pack.lanes.number_type, " ", vector, ", i64 ", j);
          vector = name;
        }
        names_[node] = vector;
        hand_on(node);
      }
}

std::string PartWriter::buffer(const std::string& tag, int at) {
  const std::string place = "%" + tag + ".p" + std::to_string(at);
  text.line(place, " = getelementptr double, ptr %", tag, ", i64 ", at);
  return place;
}

}  // namespace bellcrank
