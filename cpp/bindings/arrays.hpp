// Vectors that become NumPy arrays without a copy.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <initializer_list>
#include <utility>
#include <vector>

namespace dualdrive::python {

namespace nb = nanobind;

template <class T>
using Array = nb::ndarray<nb::numpy, T>;

// Hands the vector's memory to NumPy, row-major with the given shape.
template <class T>
Array<T> array(std::vector<T> values, std::initializer_list<std::size_t> shape) {
    auto* owner = new std::vector<T>(std::move(values));
    nb::capsule release(owner, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return Array<T>(owner->data(), shape, release);
}

// A read-only window on memory that its object keeps alive: for properties, whose policy ties both together.
template <class T>
nb::ndarray<nb::numpy, const T> view(const std::vector<T>& values, std::initializer_list<std::size_t> shape) {
    return nb::ndarray<nb::numpy, const T>(values.data(), shape);
}

}  // namespace dualdrive::python
