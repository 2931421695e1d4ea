// Results as numpy arrays.
#pragma once

#include <memory>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

namespace bellcrank {

// A new array that owns its memory; zeros.
template <class T>
struct Column {
  std::unique_ptr<T[]> memory;
  std::size_t rows, width;

  explicit Column(std::size_t count, std::size_t columns = 1)
      : memory(std::make_unique<T[]>(count * columns + 1)), rows(count), width(columns) {}

  T* operator[](std::size_t row) { return memory.get() + row * width; }

  nanobind::object array(bool flat) {
    T* data = memory.release();
    nanobind::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
    if (flat) return nanobind::cast(nanobind::ndarray<nanobind::numpy, T, nanobind::ndim<1>>(data, {rows}, owner));
    return nanobind::cast(nanobind::ndarray<nanobind::numpy, T, nanobind::ndim<2>>(data, {rows, width}, owner));
  }
};

}  // namespace bellcrank
