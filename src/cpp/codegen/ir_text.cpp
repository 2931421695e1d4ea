#include "ir_text.hpp"

namespace bellcrank {
namespace {

// An instruction that does it, e.g. "fadd", or "" where there is none.
std::string_view instruction(Op op) {
  switch (op) {
    case Op::add: return "fadd";
    case Op::sub: return "fsub";
    case Op::mul: return "fmul";
    case Op::div: return "fdiv";
    default: return "";
  }
}

std::string_view intrinsic(Op op) {
  switch (op) {
    case Op::sqrt: case Op::floor: case Op::ceil: case Op::fabs: case Op::copysign: return name_of(op);
    default: return "";
  }
}

std::string_view comparison(Op op) {
  switch (op) {
    case Op::lt: return "olt";
    case Op::le: return "ole";
    case Op::eq: return "oeq";
    case Op::ne: return "une";
    default: return "";
  }
}

// a b + c, a b - c or c - a b, rounded once.
void write_fused(Text& text, const Lanes& lanes, Op op, const std::string& name, const std::string (&args)[3]) {
  const std::string& d = lanes.number_type;
  const int negated = op == Op::fms ? 2 : op == Op::fnma ? 0 : -1;
  std::string listed;
  for (int k = 0; k < 3; ++k) {
    if (k == negated) text.line(name, ".n = fneg ", d, " ", args[k]);
    listed += (k ? ", " : "") + d + " " + (k == negated ? name + ".n" : args[k]);
  }
  text.line(name, " = call ", d, " @llvm.fma.", lanes.suffix, "(", listed, ")");
}

// The minimum or maximum of two values; NaN if either is NaN, unlike C's fmin.
void write_extreme(Text& text, const Lanes& lanes, std::string_view before, const std::string& name,
                   const std::string (&args)[3]) {
  const std::string &d = lanes.number_type, &bit = lanes.bit_type;
  text.line(name, ".b = fcmp ", before, " ", d, " ", args[0], ", ", args[1]);
  text.line(name, ".m = select ", bit, " ", name, ".b, ", d, " ", args[0], ", ", d, " ", args[1]);
  text.line(name, ".n = fcmp uno ", d, " ", args[0], ", ", args[0]);
  text.line(name, " = select ", bit, " ", name, ".n, ", d, " ", args[0], ", ", d, " ", name, ".m");
}

void write_sign(Text& text, const Lanes& lanes, const std::string& name, const std::string& of) {
  const std::string& d = lanes.number_type;
  text.line(name, ".one = call ", d, " @llvm.copysign.", lanes.suffix, "(", d, " ", lanes.number(1.0), ", ", d, " ", of,
            ")");
  text.line(name, ".z = fcmp ueq ", d, " ", of, ", ", lanes.number(0.0));  // zero, or NaN, which stays
  text.line(name, " = select ", lanes.bit_type, " ", name, ".z, ", d, " ", of, ", ", d, " ", name, ".one");
}

void write_logical(Text& text, const Lanes& lanes, Op op, const std::string& name, const std::string (&args)[3]) {
  const std::string &d = lanes.number_type, &bit = lanes.bit_type, zero = lanes.number(0.0), one = lanes.number(1.0);
  const bool is_binary = op == Op::logical_and || op == Op::logical_or;
  for (int j = 0; j < (is_binary ? 2 : 1); ++j) text.line(name, ".t", j, " = fcmp une ", d, " ", args[j], ", ", zero);
  const auto select = [&](const std::string& yes, const std::string& no) {
    text.line(name, " = select ", bit, " ", name, ".t0, ", d, " ", yes, ", ", d, " ", no);
  };
  if (op == Op::if_else_zero) {
    select(args[1], zero);
  } else if (op == Op::logical_not) {
    select(zero, one);
  } else {
    text.line(name, ".r = ", name_of(op), " ", bit, " ", name, ".t0, ", name, ".t1");
    text.line(name, " = uitofp ", bit, " ", name, ".r to ", d);
  }
}

// C library functions are called lane by lane.
void write_library_call(Text& text, const Lanes& lanes, Op op, const std::string& name, const std::string (&args)[3],
                        std::set<std::string>& library) {
  const std::string symbol(op == Op::constpow ? "pow" : name_of(op));
  library.insert(symbol);
  const int count = operand_count(op);
  const auto call = [&](const std::string& result, const auto& argument) {
    std::string listed = "double " + argument(0);
    if (count > 1) listed += ", double " + argument(1);
    text.line(result, " = call double @", symbol, "(", listed, ")");
  };
  if (lanes.width == 1) return call(name, [&](int j) { return args[j]; });
  std::string whole = "poison";
  for (int lane = 0; lane < lanes.width; ++lane) {
    const std::string one = name + "." + std::to_string(lane);
    for (int j = 0; j < count; ++j)
      text.line(one, ".", j, " = extractelement ", lanes.number_type, " ", args[j], ", i64 ", lane);
    call(one, [&](int j) { return one + "." + std::to_string(j); });
    const std::string result = lane == lanes.width - 1 ? name : name + ".w" + std::to_string(lane);
    text.line(result, " = insertelement ", lanes.number_type, " ", whole, ", double ", one, ", i64 ", lane);
    whole = result;
  }
}

}  // namespace

std::string filled(std::string_view format, std::initializer_list<std::pair<std::string_view, std::string_view>> names) {
  std::string found;
  for (std::size_t at = 0; at < format.size();) {
    const std::size_t open = format.find('{', at);
    found += format.substr(at, open - at);
    if (open == std::string_view::npos) break;
    const std::size_t close = format.find('}', open);
    for (const auto& [name, value] : names)
      if (format.substr(open + 1, close - open - 1) == name) found += value;
    at = close + 1;
  }
  return found;
}

void write_operation(Text& text, const Lanes& lanes, Op op, const std::string& name, const std::string (&args)[3],
                     std::set<std::string>& library) {
  const std::string& d = lanes.number_type;
  if (!instruction(op).empty()) {
    text.line(name, " = ", instruction(op), " ", d, " ", args[0], ", ", args[1]);
  } else if (op == Op::neg) {
    text.line(name, " = fneg ", d, " ", args[0]);
  } else if (op == Op::sq) {
    text.line(name, " = fmul ", d, " ", args[0], ", ", args[0]);
  } else if (op == Op::twice) {
    text.line(name, " = fadd ", d, " ", args[0], ", ", args[0]);
  } else if (op == Op::inv) {
    text.line(name, " = fdiv ", d, " ", lanes.number(1.0), ", ", args[0]);
  } else if (op >= Op::fma) {
    write_fused(text, lanes, op, name, args);
  } else if (!intrinsic(op).empty()) {
    const std::string more = operand_count(op) > 1 ? ", " + d + " " + args[1] : "";
    text.line(name, " = call ", d, " @llvm.", intrinsic(op), ".", lanes.suffix, "(", d, " ", args[0], more, ")");
  } else if (!comparison(op).empty()) {
    text.line(name, ".b = fcmp ", comparison(op), " ", d, " ", args[0], ", ", args[1]);
    text.line(name, " = uitofp ", lanes.bit_type, " ", name, ".b to ", d);
  } else if (op == Op::fmin || op == Op::fmax) {
    write_extreme(text, lanes, op == Op::fmin ? "olt" : "ogt", name, args);
  } else if (op == Op::sign) {
    write_sign(text, lanes, name, args[0]);
  } else if (op == Op::logical_not || op == Op::logical_and || op == Op::logical_or || op == Op::if_else_zero) {
    write_logical(text, lanes, op, name, args);
  } else {
    write_library_call(text, lanes, op, name, args, library);
  }
}

}  // namespace bellcrank
