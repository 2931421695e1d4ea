#include "instruction_order.hpp"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <numeric>
#include <queue>

namespace bellcrank {
namespace {

constexpr int REGISTERS = 32, NEAR = 512;  // values that fit in the registers, and in the first-level cache
constexpr int FAR_COST = 3;  // of a value outside the first-level cache, in reloads from it (fitted to measured times)

// Reloads: operands last touched more operations ago than there are registers, or than the cache holds.
long cost(const Reads& reads, const std::vector<int>& order) {
  std::vector<int> touched(reads.size());
  long total = 0;
  for (int now = 0; now < static_cast<int>(order.size()); ++now) {
    for (const int a : reads[order[now]]) {
      const int ago = now - touched[a];
      if (ago > REGISTERS) total += ago > NEAR ? FAR_COST + 1 : 1;
      touched[a] = now;
    }
    touched[order[now]] = now;
  }
  return total;
}

// List scheduling: of the operations that are ready the one after which the fewest values wait. Ties go to the
// operation that became ready last, or to the first in the order `base`.
class Greedy {
 public:
  Greedy(const Reads& reads, const std::vector<int>& base, bool newest_first)
      : reads_(reads), newest_first_(newest_first), count_(static_cast<std::int64_t>(reads.size())), turn_(9 * count_) {
    readers_.resize(reads.size());
    for (const int i : base)
      for (const int a : reads[i]) readers_[a].push_back(i);
    ties_.resize(reads.size());
    for (std::size_t k = 0; k < base.size(); ++k) ties_[base[k]] = static_cast<std::int64_t>(k);
    for (std::size_t i = 0; i < reads.size(); ++i) {
      missing_.push_back(static_cast<int>(reads[i].size()));
      waiting_.push_back(static_cast<int>(readers_[i].size()));
    }
    valid_.resize(reads.size(), NONE);
    for (const int i : base)
      if (!missing_[i]) offer(i);
  }

  std::vector<int> order() {
    std::vector<int> found;
    while (!ready_.empty()) {
      const std::int64_t key = ready_.top();
      ready_.pop();
      const int i = static_cast<int>(key % count_);
      if (valid_[i] != key) continue;
      valid_[i] = NONE;
      found.push_back(i);
      finish(i);
    }
    return found;
  }

 private:
  static constexpr std::int64_t NONE = -1;
  const Reads& reads_;
  const bool newest_first_;
  const std::int64_t count_;
  std::int64_t turn_;
  Reads readers_;
  std::vector<int> missing_, waiting_;      // operands yet to be computed; operations yet to read a value
  std::vector<std::int64_t> ties_, valid_;  // valid: an operation's present key in the heap
  // (values added, tie, operation), as one number
  std::priority_queue<std::int64_t, std::vector<std::int64_t>, std::greater<>> ready_;

  void offer(int i) {
    std::int64_t added = readers_[i].empty() ? 3 : 4;  // one more than are added, so that none is negative
    for (const int a : reads_[i]) added -= waiting_[a] == 1;
    --turn_;
    valid_[i] = (added * 10 * count_ + (newest_first_ ? turn_ : ties_[i])) * count_ + i;
    ready_.push(valid_[i]);
  }

  void finish(int i) {
    for (const int a : reads_[i])
      if (--waiting_[a] == 1)
        for (const int other : readers_[a])
          if (valid_[other] != NONE) offer(other);
    for (const int other : readers_[i])
      if (--missing_[other] == 0) offer(other);
  }
};

}  // namespace

std::vector<int> depth_first(const Reads& reads, const std::vector<int>& outputs) {
  std::vector<int> depth(reads.size()), order, stack(outputs), waiting;
  for (std::size_t i = 0; i < reads.size(); ++i)
    for (const int a : reads[i]) depth[i] = std::max(depth[i], depth[a] + 1);
  std::vector<char> done(reads.size());
  while (!stack.empty()) {
    const int i = stack.back();
    waiting.clear();
    if (!done[i])
      for (const int a : reads[i])
        if (!done[a]) waiting.push_back(a);
    if (!waiting.empty()) {
      std::stable_sort(waiting.begin(), waiting.end(), [&](int a, int b) { return depth[a] < depth[b]; });
      stack.insert(stack.end(), waiting.begin(), waiting.end());
      continue;
    }
    stack.pop_back();
    if (!done[i]) order.push_back(i);
    done[i] = true;
  }
  return order;
}

std::vector<int> local_order(const Reads& reads, const std::vector<int>& outputs, bool quick) {
  std::vector<int> best(reads.size());
  std::iota(best.begin(), best.end(), 0);
  long least = cost(reads, best);
  const auto compare = [&](std::vector<int> order) {
    const long found = cost(reads, order);
    if (found < least) {
      least = found;
      best = std::move(order);
    }
  };
  compare(depth_first(reads, outputs));
  if (quick) return best;
  const std::vector<int> base = best;
  for (const bool newest_first : {false, true}) compare(Greedy(reads, base, newest_first).order());
  return best;
}

}  // namespace bellcrank
