// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

namespace veneer {

/// A borrowed rectangle of pixels, row by row from the top. `stride` is in pixels. Passed by value;
/// never kept beyond the call.
template <class Pixel>
class ImageView {
 public:
  ImageView() = default;
  ImageView(Pixel* data, int width, int height, std::ptrdiff_t stride)
      : data_(data), width_(width), height_(height), stride_(stride) {}
  /// A view of const pixels from one of mutable pixels.
  template <class Other>
  requires(std::is_same_v<const Other, Pixel> && !std::is_same_v<Other, Pixel>)
      // NOLINTNEXTLINE(google-explicit-constructor): adding const is no conversion to be spelt out
      ImageView(const ImageView<Other>& other)
      : data_(other.data()),
        width_(other.width()),
        height_(other.height()),
        stride_(other.stride()) {}

  [[nodiscard]] Pixel* data() const { return data_; }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] std::ptrdiff_t stride() const { return stride_; }
  [[nodiscard]] bool empty() const { return width_ == 0 || height_ == 0; }
  [[nodiscard]] Pixel& operator()(int x, int y) const { return data_[y * stride_ + x]; }
  [[nodiscard]] std::span<Pixel> row(int y) const {
    return {data_ + y * stride_, static_cast<std::size_t>(width_)};
  }

 private:
  Pixel* data_ = nullptr;
  int width_ = 0;
  int height_ = 0;
  std::ptrdiff_t stride_ = 0;
};

/// A pixel whose channels are all 0; `Pixel{}` would leave Eigen's vectors as they were.
template <class Pixel>
[[nodiscard]] Pixel black_pixel() {
  if constexpr (requires { Pixel::Zero(); }) {
    return Pixel::Zero();
  } else {
    return Pixel{};
  }
}

/// Owns a rectangle of pixels, without padding.
template <class Pixel>
class Image {
 public:
  Image() = default;
  Image(int width, int height, const Pixel& fill = black_pixel<Pixel>())
      : width_(width),
        height_(height),
        pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), fill) {}

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] bool empty() const { return pixels_.empty(); }
  [[nodiscard]] Pixel& operator()(int x, int y) { return pixels_[index(x, y)]; }
  [[nodiscard]] const Pixel& operator()(int x, int y) const { return pixels_[index(x, y)]; }
  [[nodiscard]] std::span<Pixel> pixels() & { return pixels_; }
  [[nodiscard]] std::span<const Pixel> pixels() const& { return pixels_; }
  std::span<const Pixel> pixels() const&& = delete;
  [[nodiscard]] ImageView<Pixel> view() & { return {pixels_.data(), width_, height_, width_}; }
  [[nodiscard]] ImageView<const Pixel> view() const& {
    return {pixels_.data(), width_, height_, width_};
  }
  ImageView<const Pixel> view() const&& = delete;

 private:
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  int width_ = 0;
  int height_ = 0;
  std::vector<Pixel> pixels_;
};

using Rgb8 = std::array<std::uint8_t, 3>;
using Rgb16 = std::array<std::uint16_t, 3>;
/// Three floats: linear RGB or XYZ; the variable's name says which.
using Rgb32f = Eigen::Vector3f;

}  // namespace veneer
