// Slots of memory that are taken and given back.
#pragma once

#include <iterator>
#include <map>

namespace bellcrank {

class Slots {
 public:
  int memory = 0;  // the most that were in use

  // The first of `length` free slots in a row.
  int take(int length) {
    for (auto block = free_.begin(); block != free_.end(); ++block) {
      const auto [start, size] = *block;
      if (size < length) continue;
      free_.erase(block);
      if (size > length) free_[start + length] = size - length;
      return start;
    }
    int start = memory;
    if (!free_.empty() && free_.rbegin()->first + free_.rbegin()->second == memory) {
      start = free_.rbegin()->first;
      free_.erase(start);
    }
    memory = start + length;
    return start;
  }

  void give_back(int start, int length) {
    auto after = free_.lower_bound(start);
    if (after != free_.end() && after->first == start + length) {
      length += after->second;
      after = free_.erase(after);
    }
    if (after != free_.begin()) {
      const auto before = std::prev(after);
      if (before->first + before->second == start) {
        before->second += length;
        return;
      }
    }
    free_[start] = length;
  }

 private:
  std::map<int, int> free_;  // length by start; blocks do not touch
};

}  // namespace bellcrank
