#include "rolled_code.hpp"
namespace bellcrank {
std::optional<Code> write_rolled(const Graph&, const Uses&, const std::vector<Stage>&,
                                 const CodeStyle&, const Limits&) { return {}; }
}
