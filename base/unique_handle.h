// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unistd.h>

#include <utility>

namespace veneer {

/// Owns a handle that is a plain value (a file descriptor); move-only, closes unless empty.
template <class T, T kEmpty, class Close>
class UniqueHandle {
 public:
  UniqueHandle() = default;
  explicit UniqueHandle(T value) : value_(value) {}
  UniqueHandle(UniqueHandle&& other) noexcept : value_(std::exchange(other.value_, kEmpty)) {}
  UniqueHandle& operator=(UniqueHandle&& other) noexcept {
    if (this != &other) {
      reset();
      value_ = std::exchange(other.value_, kEmpty);
    }
    return *this;
  }
  UniqueHandle(const UniqueHandle&) = delete;
  UniqueHandle& operator=(const UniqueHandle&) = delete;
  ~UniqueHandle() { reset(); }

  [[nodiscard]] T value() const { return value_; }
  explicit operator bool() const { return value_ != kEmpty; }
  void reset() {
    if (value_ != kEmpty) Close{}(std::exchange(value_, kEmpty));
  }

 private:
  T value_ = kEmpty;
};

struct CloseFd {
  void operator()(int fd) const noexcept { ::close(fd); }
};
using UniqueFd = UniqueHandle<int, -1, CloseFd>;

}  // namespace veneer
