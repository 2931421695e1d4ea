// Work on many designs in threads, each design by itself.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <system_error>
#include <thread>
#include <vector>

namespace bellcrank {

// `make()` gives each thread its own worker, which is called with the number of each design.
template <class Make>
void for_each_design(std::size_t designs, int threads, const Make& make) {
  constexpr std::size_t taken = 64;  // designs at a time
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    auto worker = make();
    for (std::size_t first; (first = next.fetch_add(taken)) < designs;)
      for (std::size_t k = first; k < std::min(first + taken, designs); ++k) worker(k);
  };
  std::vector<std::thread> others;
  const std::size_t most = std::min<std::size_t>(std::max(threads, 1), (designs + taken - 1) / taken);
  try {
    for (std::size_t k = 1; k < most; ++k) others.emplace_back(work);
  } catch (const std::system_error&) {  // no more threads are left: these do it
  }
  work();
  for (std::thread& other : others) other.join();
}

}  // namespace bellcrank
