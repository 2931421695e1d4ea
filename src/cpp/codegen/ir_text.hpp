// Text in LLVM's assembly language: lines, types of SIMD lanes, and templates of loads, stores and sines.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "graph.hpp"

namespace bellcrank {

// Type names and constants for a vector of `width` doubles (a plain double where it is 1).
struct Lanes {
  int width;
  std::string number_type, bit_type, suffix;

  explicit Lanes(int lanes) : width(lanes) {
    const std::string count = std::to_string(lanes);
    number_type = lanes > 1 ? "<" + count + " x double>" : "double";
    bit_type = lanes > 1 ? "<" + count + " x i1>" : "i1";
    suffix = lanes > 1 ? "v" + count + "f64" : "f64";
  }

  std::string number(double value) const {  // in every lane, to the bit
    const std::string text = literal(value);
    return width > 1 ? "splat (double " + text + ")" : text;
  }

  static std::string literal(double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    char text[24];
    std::snprintf(text, sizeof text, "0x%016llX", static_cast<unsigned long long>(bits));
    return text;
  }
};

// Lines of code.
class Text {
 public:
  std::string text;

  template <class... Pieces>
  void line(const Pieces&... pieces) {  // an instruction
    text += "  ";
    add(pieces...);
  }

  template <class... Pieces>
  void add(const Pieces&... pieces) {
    (append(pieces), ...);
    text += '\n';
  }

 private:
  void append(std::string_view piece) { text += piece; }
  void append(const char* piece) { text += piece; }
  void append(const std::string& piece) { text += piece; }
  void append(long number) { text += std::to_string(number); }
  void append(int number) { text += std::to_string(number); }
  void append(std::size_t number) { text += std::to_string(number); }
};

// A text in which names in braces stand for other texts.
std::string filled(std::string_view format, std::initializer_list<std::pair<std::string_view, std::string_view>> names);

// The code of a sine and a cosine with {tag} before every name and {x} for the angle.
struct SineCode {
  std::string lines, sine, cosine, beyond;
};

// What code is generated for.
struct CodeStyle {
  Lanes lanes;
  bool fused;                          // whether there is a fused multiply-add
  int packed;                          // how many angles of one sample may share a vector
  std::string load, store;             // of inputs and outputs, with {k}, {i} and {name}; {at} in stores
  std::vector<std::string> pointers;   // that these use
  std::map<int, SineCode> sine_codes;  // by the width of the vector

  std::string load_of(int which, std::string_view entry, std::string_view name) const {
    return filled(load, {{"k", std::to_string(which)}, {"i", entry}, {"name", name}});
  }
  // `at` becomes the name of the place.
  std::string store_of(int which, std::string_view entry, std::string_view name, std::string_view at) const {
    return filled(store, {{"k", std::to_string(which)}, {"i", entry}, {"name", name}, {"at", at}});
  }
  std::string store_of(int which, int entry, std::string_view name) const {
    const std::string i = std::to_string(entry);
    return store_of(which, i, name, "%out" + std::to_string(which) + "." + i + ".p");
  }
};

// Writes one operation; functions of the C library that it calls are added to `library`.
void write_operation(Text& text, const Lanes& lanes, Op op, const std::string& name, const std::string (&args)[3],
                     std::set<std::string>& library);

}  // namespace bellcrank
