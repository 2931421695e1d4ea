// Work on many designs in threads, each design by itself.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

namespace bellcrank {

constexpr std::size_t spare_memory = std::size_t{1} << 27;  // bytes; address space alone, as nothing is written to it

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
  // Where the system starts few threads, they have taken all of its memory. What they need first, such as memory for
  // thread-local data, is kept free for them until all have been started; they begin then.
  std::unique_ptr<char[]> spare(new (std::nothrow) char[spare_memory]);
  std::mutex gate;
  const auto begin = [&] {
    { std::lock_guard<std::mutex> wait(gate); }
    work();
  };
  std::vector<std::thread> others;
  const std::size_t most = std::min<std::size_t>(std::max(threads, 1), (designs + taken - 1) / taken);
  {
    std::lock_guard<std::mutex> held(gate);
    try {
      for (std::size_t k = 1; k < most; ++k) others.emplace_back(begin);
    } catch (const std::system_error&) {  // no more threads are left: these do it
    }
    spare.reset();
  }
  work();
  for (std::thread& other : others) other.join();
}

}  // namespace bellcrank
