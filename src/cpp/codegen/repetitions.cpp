#include "repetitions.hpp"

#include <algorithm>
#include <cstdint>
#include <unordered_map>

namespace bellcrank {
namespace {

constexpr int SAMPLE = 12;     // operations that must agree where a repetition may begin
constexpr int CANDIDATES = 8;  // next occurrences that are tried as the second instance
constexpr int FEWEST = 3;      // instances
constexpr int SHORTEST = 6;    // operations of an instance: a loop of fewer costs more than they do
constexpr int LEAST = 64;      // operations that a run must save

class Search {
 public:
  Search(const Graph& graph, const std::vector<int>& operations)
      : graph_(graph), operations_(operations), size_(static_cast<int>(operations.size())) {
    place_.assign(graph.nodes.size(), -1);
    for (int i = 0; i < size_; ++i) place_[operations[i]] = i;
    find_next_occurrences();
    count_live();
  }

  std::vector<Run> runs() const {
    std::vector<Run> found;
    std::unordered_map<int, int> broken;  // by period: where the repetition that was tried last ends
    for (int i = 0; i < size_;) {
      Run best{i, 0, 0};
      int j = next_[i];
      for (int tries = 0; j >= 0 && tries < CANDIDATES; ++tries, j = next_[j]) {
        const int period = j - i;
        if (period < SHORTEST) continue;
        const auto end = broken.find(period);
        if (end != broken.end() && end->second > i && end->second - i < FEWEST * period) continue;
        const int count = instances(i, period);
        broken[period] = i + (count + 1) * period;
        if (count >= FEWEST && count * period > best.count * best.period * 21 / 20) best = {i, period, count};
      }
      if ((best.count - 1) * best.period >= LEAST) {
        best = with_few_values_between(best);
        found.push_back(best);
        i = best.start + best.period * best.count;
      } else {
        ++i;
      }
    }
    return found;
  }

 private:
  const Graph& graph_;
  const std::vector<int>& operations_;
  const int size_;
  std::vector<int> place_;  // by node: where it is computed in the sequence, -1 if elsewhere
  std::vector<int> next_;   // by place: where the next SAMPLE operations occur again
  std::vector<int> live_;   // by place: the values that wait there

  const Node& node(int place) const { return graph_.nodes[operations_[place]]; }

  void find_next_occurrences() {
    std::vector<std::uint64_t> kind(size_);
    const auto mix = [](std::uint64_t hash, std::uint64_t value) {
      hash = (hash ^ value) * 0x9E3779B97F4A7C15u;
      return hash ^ hash >> 29;
    };
    for (int i = 0; i < size_; ++i) {
      kind[i] = mix(7, static_cast<std::uint64_t>(node(i).op));
      for (int k = 0; k < node(i).operands(); ++k) {
        const int at = place_[node(i).operand[k]];
        kind[i] = mix(kind[i], at >= 0 && i - at <= SAMPLE ? i - at : 0);
      }
    }
    next_.assign(size_, -1);
    std::unordered_map<std::uint64_t, int> last;
    for (int i = size_ - SAMPLE; i >= 0; --i) {
      std::uint64_t hash = 3;
      for (int k = 0; k < SAMPLE; ++k) hash = mix(hash, kind[i + k]);
      const auto [known, is_new] = last.try_emplace(hash, i);
      if (!is_new) next_[i] = known->second;
      known->second = i;
    }
  }

  void count_live() {
    std::vector<int> last(size_, -1);
    for (int i = 0; i < size_; ++i)
      for (int k = 0; k < node(i).operands(); ++k)
        if (place_[node(i).operand[k]] >= 0) last[place_[node(i).operand[k]]] = i;
    live_.assign(size_ + 1, 0);
    for (int i = 0; i < size_; ++i)
      if (last[i] > i) {
        ++live_[i + 1];
        --live_[last[i] + 1];
      }
    for (int i = 0; i < size_; ++i) live_[i + 1] += live_[i];
  }

  // Whether operation i, of the instance that begins at `first`, is repeated a period later.
  bool repeats(int i, int first, int period) const {
    const Node &a = node(i), &b = node(i + period);
    if (a.op != b.op) return false;
    for (int k = 0; k < a.operands(); ++k) {
      const int p = place_[a.operand[k]], q = place_[b.operand[k]];
      const bool inside = p >= first;
      if (inside != (q >= first + period) || (inside && q - p != period)) return false;
    }
    return true;
  }

  int instances(int start, int period) const {
    int i = start;
    while (i + period < size_ && repeats(i, start + (i - start) / period * period, period)) ++i;
    return (i - start) / period + 1;
  }

  // The run begun later in its period, where fewer values go from instance to instance.
  Run with_few_values_between(const Run& run) const {
    Run best = run;
    int fewest = live_[run.start + run.count / 2 * run.period];
    for (int shift = 1; shift < run.period; ++shift) {
      const int start = run.start + shift, live = live_[start + (run.count - 1) / 2 * run.period];
      if (live >= fewest) continue;
      const int count = instances(start, run.period);
      if (count < run.count - 1 || count < FEWEST) continue;
      fewest = live;
      best = {start, run.period, count};
    }
    return best;
  }
};

}  // namespace

std::vector<Run> repetitions(const Graph& graph, const std::vector<int>& operations) {
  return static_cast<int>(operations.size()) < SAMPLE ? std::vector<Run>{} : Search(graph, operations).runs();
}

}  // namespace bellcrank
