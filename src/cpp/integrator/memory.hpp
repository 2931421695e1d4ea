// Memory of the engine: zeroed arrays aligned for SIMD, and arrays that grow.
#pragma once

#include <cstdlib>
#include <cstring>
#include <new>

namespace bellcrank {
namespace BELLCRANK_ISA {

[[noreturn]] inline void out_of_memory() {
#ifdef __cpp_exceptions
  throw std::bad_alloc();
#else
  __builtin_trap();  // in a page
#endif
}

// Zeroed memory, aligned and padded for SIMD. Small arrays lie within the object itself, because a short run takes only as
// long as a few calls of the allocator.
template <class T>
class Array {
 public:
  explicit Array(std::size_t size) {
    const std::size_t bytes = (size * sizeof(T) / 64 + 1) * 64;
    data_ = reinterpret_cast<T*>(bytes <= sizeof own_ ? own_ : std::aligned_alloc(64, bytes));
    if (!data_) out_of_memory();
    std::memset(static_cast<void*>(data_), 0, bytes);
  }
  ~Array() {
    if (static_cast<void*>(data_) != own_) std::free(data_);
  }
  Array(const Array&) = delete;
  Array& operator=(const Array&) = delete;
  operator T*() { return data_; }
  operator const T*() const { return data_; }

 private:
  alignas(64) unsigned char own_[256];
  T* data_;
};
using Buffer = Array<double>;

// Memory that grows, for plain data.
template <class T>
class Growing {
 public:
  Growing() = default;
  ~Growing() { std::free(data_); }
  Growing(const Growing&) = delete;
  Growing& operator=(const Growing&) = delete;
  void reserve(std::size_t size) {
    if (size <= room_) return;
    const std::size_t room = size > 2 * room_ ? size + 16 : 2 * room_;
    void* data = std::realloc(data_, room * sizeof(T));
    if (!data) out_of_memory();
    data_ = static_cast<T*>(data), room_ = room;
  }
  operator T*() { return data_; }
  operator const T*() const { return data_; }

 private:
  T* data_ = nullptr;
  std::size_t room_ = 0;
};

}  // namespace BELLCRANK_ISA
}  // namespace bellcrank
